"""The objective of tuning: the numbers of the program, for whoever optimises."""

import json
import math
import os
import subprocess
from typing import Any

import echoloop
import numpy as np
import pytest

SMALL = {
    "scanner.pattern": "grid",
    "scanner.columns": 80,
    "scanner.rows": 16,
    "scene.source": "structured",
    "scene.towns": [5],
    "data.train_pairs": 2,
    "data.test_pairs": 1,
}


@pytest.fixture(scope="module")
def objective() -> echoloop.Objective:
    return echoloop.Objective(SMALL)


def test_a_candidate_has_the_fitness_of_the_program(objective: echoloop.Objective) -> None:
    candidate = {"lidar.power": 20.0, "registration.voxel_m": 0.3}
    sets = [f"--set={key}={value}" for key, value in SMALL.items()]
    line = json.dumps({"parameters": candidate})
    done = subprocess.run(
        [os.environ["ECHOLOOP_PROGRAM"], "evaluate", "--stream", "--quiet", *sets],
        input=line, capture_output=True, text=True, check=True,
    )
    greeting, told = (json.loads(line) for line in done.stdout.splitlines())
    assert objective.axes == greeting["axes"]
    found = objective.evaluate(candidate)
    assert found["fitness"] == told["fitness"] == objective(candidate)
    assert found["summary"] == told["summary"] and found["parameters"] == told["parameters"]
    assert len(objective) == len(found["summary"]["errors"]) == 2


def test_points_and_names_are_the_same_candidate(objective: echoloop.Objective) -> None:
    point = np.full(len(objective.axes), 0.5)
    found = objective.evaluate(point)
    assert objective(found["parameters"]) == objective(list(point)) == found["fitness"]
    assert objective.start.keys() == found["parameters"].keys()
    assert objective(objective.start) == objective({}) == objective(objective.start_point)


@pytest.mark.parametrize(
    ("candidate", "error", "said"),
    [
        ({"lidar.power": 1e9}, echoloop.Infeasible, "power"),
        ({"lidar.pover": 1.0}, ValueError, "candidate: .*lidar.pover"),
        ([0.5], ValueError, "point has 1 numbers, expected"),
    ],
)
def test_what_cannot_be_judged_is_named(
    objective: echoloop.Objective, candidate: Any, error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        objective.evaluate(candidate)
    if error is echoloop.Infeasible:
        assert objective(candidate) == math.inf


def test_settings_may_be_tables_and_numbers_of_numpy(objective: echoloop.Objective) -> None:
    own = {
        "scanner.columns": np.int64(80),
        "scene.towns": np.array([5]),
        "tune.warm_starts": [{"lidar.power": 30.0}],
    }
    same = echoloop.Objective({**SMALL, **own})
    assert same({}) == objective({}) and same.axes == objective.axes
    with pytest.raises(ValueError, match="scene.towns: expected numbers, words and lists"):
        echoloop.Objective({"scene.towns": object()})


@pytest.mark.parametrize(
    ("settings", "more", "said"),
    [
        ({"scene.sauce": "x"}, {}, "sauce"),
        ({"scanner.rows": -1}, {}, "scanner.rows"),
        ({"scene.source": "nowhere.ply"}, {}, "nowhere.ply"),
        ({}, {"pairs": "all"}, "pairs: expected one of train, test"),
        ({}, {"config": "none.toml"}, "none.toml"),
    ],
)
def test_a_bad_configuration_is_named(
    settings: dict[str, Any], more: dict[str, Any], said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        echoloop.Objective({**SMALL, **settings}, **more)
