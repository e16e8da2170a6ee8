"""pycma searches: python pycma_search.py [flags of `echoloop evaluate`]."""
import json, subprocess, sys
import cma

command = ["echoloop", "evaluate", "--stream", "--quiet", *sys.argv[1:]]
loop = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
axes = json.loads(loop.stdout.readline())

def ask(point):
    print(json.dumps({"point": list(point)}), file=loop.stdin, flush=True)
    return json.loads(loop.stdout.readline())

options = {"bounds": [0, 1], "seed": 1, "maxfevals": 60, "verbose": -9}
search = cma.CMAEvolutionStrategy(axes["start"], 0.2, options)
search.optimize(lambda point: ask(point)["fitness"])
print(json.dumps(ask(search.result.xbest)))
