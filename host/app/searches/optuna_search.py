"""Optuna searches: python optuna_search.py [flags of `echoloop evaluate`]."""
import json, subprocess, sys
import optuna

command = ["echoloop", "evaluate", "--stream", "--quiet", *sys.argv[1:]]
loop = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
axes = json.loads(loop.stdout.readline())["axes"]

def suggest(trial, axis):
    name, low, high, scale = axis["name"], axis["min"], axis["max"], axis["scale"]
    if axis["choices"]:
        return trial.suggest_categorical(name, axis["choices"])
    if scale == "power-of-two":
        return trial.suggest_categorical(name, [2**k for k in range(20) if low <= 2**k <= high])
    if scale == "integer":
        return trial.suggest_int(name, low, high)
    return trial.suggest_float(name, low, high, log=scale == "log")

def ask(trial):
    parameters = {axis["name"]: suggest(trial, axis) for axis in axes}
    print(json.dumps({"parameters": parameters}), file=loop.stdin, flush=True)
    answer = json.loads(loop.stdout.readline())
    if "fitness" not in answer:  # what the sensor or the method refuses
        raise optuna.TrialPruned(answer["infeasible"])
    trial.set_user_attr("answer", answer)
    return answer["fitness"]

study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
study.optimize(ask, n_trials=60)
print(json.dumps(study.best_trial.user_attrs["answer"]))
