"""Nevergrad searches: python nevergrad_search.py [flags of `echoloop evaluate`]."""
import json, subprocess, sys
import nevergrad

command = ["echoloop", "evaluate", "--stream", "--quiet", *sys.argv[1:]]
loop = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
axes = json.loads(loop.stdout.readline())

def ask(point):
    print(json.dumps({"point": list(point)}), file=loop.stdin, flush=True)
    return json.loads(loop.stdout.readline())

cube = nevergrad.p.Array(init=axes["start"]).set_bounds(0, 1)
search = nevergrad.optimizers.NGOpt(parametrization=cube, budget=60)
search.parametrization.random_state.seed(1)
best = search.minimize(lambda point: ask(point)["fitness"])
print(json.dumps(ask(best.value)))
