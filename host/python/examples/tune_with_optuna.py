"""Tune the sensor and the registration together with Optuna, on simulated streets.

python tune_with_optuna.py --trials 200
"""

import argparse
import json

import echoloop
import optuna


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE",
                        help="key of the configuration, as scene.source=structured")
    args = parser.parse_args()

    settings = dict(text.split("=", 1) for text in args.set)
    train = echoloop.Objective(settings)
    print(train)

    names = [axis["name"] for axis in train.axes]

    def point(values: dict[str, float]) -> list[float]:
        return [values[name] for name in names]

    def fitness(trial: optuna.Trial) -> float:
        # A point of the unit cube: what does not go together is repaired.
        return train([trial.suggest_float(name, 0.0, 1.0) for name in names])

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=args.seed))
    study.enqueue_trial(dict(zip(names, train.start_point, strict=True)))
    study.optimize(fitness, n_trials=args.trials)

    # On pairs that the search did not see.
    test = echoloop.Objective(settings, pairs="test")
    for name, candidate in [("start", train.start_point), ("tuned", point(study.best_params))]:
        summary = test.evaluate(candidate)["summary"]
        median_cm = 100 * summary["median_translation_m"]
        print(f"{name}: recall {summary['recall_pct']:.1f} %, median error {median_cm:.2f} cm")
    tuned = train.evaluate(point(study.best_params))["parameters"]
    print(json.dumps({"parameters": tuned}, indent=1))  # as `echoloop evaluate --candidate` reads


if __name__ == "__main__":
    main()
