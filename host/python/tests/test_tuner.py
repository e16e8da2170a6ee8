"""A search whose tasks run anywhere is the search of the program."""

import json
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import echoloop
import pytest
from conftest import Run
from echoloop.typing import Result, Task

SMALL = {
    "scanner.pattern": "grid",
    "scanner.columns": 24,
    "scanner.rows": 8,
    "scene.source": "structured",
    "scene.towns": [1],
    "data.train_pairs": 2,
    "data.check_pairs": 2,
    "data.test_pairs": 1,
    "tune.generations": 3,
    "tune.population": 3,
    "tune.shortlist": 1,
}

worker: echoloop.Worker


def begin() -> None:
    """Makes the worker of a process."""
    global worker
    worker = echoloop.Worker(SMALL)


def work(task: Task) -> Result:
    return worker.work(task)


@pytest.fixture(scope="module")
def program(run: Run, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Result of the program's own search."""
    runs = tmp_path_factory.mktemp("runs")
    sets = [f"--set={key}={value}" for key, value in SMALL.items()]
    run("tune", "--quiet", "--json", "--runs", runs, *sets)
    result: dict[str, Any] = json.loads((runs / "latest" / "result.json").read_text())
    return result


def test_two_processes_find_what_the_program_finds(
    program: dict[str, Any], tmp_path: Path
) -> None:
    tuner = echoloop.Tuner(tmp_path / "run", SMALL)
    # A process of its own each: a fork would share the threads of this one.
    with ProcessPoolExecutor(2, get_context("spawn"), begin) as pool:
        while not tuner.done:
            for told in as_completed([pool.submit(work, task) for task in tuner.ask()]):
                assert tuner.tell(told.result())
    assert tuner.result == program
    assert json.loads((tmp_path / "run" / "result.json").read_text()) == program


def test_a_search_goes_on_where_it_was_left(program: dict[str, Any], tmp_path: Path) -> None:
    run = tmp_path / "run"
    tuner = echoloop.Tuner(run, SMALL)
    worker = tuner.worker()
    for _ in range(4):
        for task in tuner.ask():
            tuner.tell(worker.work(task))
    assert not tuner.done and tuner.result is None
    assert 1 < len((run / "history.jsonl").read_text().splitlines()), "more than the header"
    with pytest.raises(ValueError, match=r"run\.lock.*another process"):
        echoloop.Tuner(run)
    tuner.close()
    with pytest.raises(ValueError, match=r"config\.toml is of another configuration"):
        echoloop.Tuner(run, {**SMALL, "seed": 9})
    with echoloop.Tuner(run) as tuner:  # with the configuration of the run
        while not tuner.done:
            for task in reversed(tuner.ask(3)):
                tuner.tell(worker.work(task))
        assert tuner.result == program
    with echoloop.Tuner(run) as ended:
        assert ended.done and ended.result == program and ended.ask() == []


def test_a_folder_that_is_no_run_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "README.txt").write_text("mine")
    with pytest.raises(ValueError, match="run: .*expected a run's folder"):
        echoloop.Tuner(tmp_path, SMALL)
    assert [path.name for path in tmp_path.iterdir()] == ["README.txt"]
    assert (tmp_path / "README.txt").read_text() == "mine"


def test_a_task_of_a_lost_worker_is_handed_out_again(tmp_path: Path) -> None:
    with echoloop.Tuner(tmp_path / "run", SMALL) as tuner:
        lost = tuner.ask()
        began = time.monotonic()
        assert tuner.ask(patience_s=0.3) == [] and time.monotonic() - began >= 0.3
        assert tuner.ask(again=True) == lost and tuner.ask(1, again=True) == lost[:1]
        worker = tuner.worker()
        for task in tuner.ask(again=True):
            assert tuner.tell(worker.work(task))
        assert tuner.ask(), "the search goes on"
        assert not tuner.tell(worker.work(lost[0])), "the lost worker is back"


def test_a_result_of_the_search_before_is_not_taken_for_another_task(tmp_path: Path) -> None:
    with echoloop.Tuner(tmp_path / "run", SMALL) as tuner:
        worker = tuner.worker()
        late = [worker.work(task) for task in tuner.ask()]
        for result in late:
            tuner.tell(result)
        late = [worker.work(task) for task in tuner.ask()]
    with echoloop.Tuner(tmp_path / "run") as tuner:
        for result in late:
            with pytest.raises(ValueError, match="no task|another task of that number"):
                tuner.tell(result)
        assert tuner.progress["done"] == 0


def test_a_task_of_another_search_is_refused(tmp_path: Path) -> None:
    tuner = echoloop.Tuner(tmp_path / "run", SMALL)
    (task,) = tuner.ask(1)
    other = echoloop.Worker({**SMALL, "seed": 9})
    own = tuner.worker()
    with pytest.raises(ValueError, match=rf"task: .*{task['search']['configuration']}"):
        other.work(task)
    result = own.work(task)
    with pytest.raises(ValueError, match="result: task 0: expected 1 errors, found 0"):
        tuner.tell({**result, "result": {**result["result"], "errors": []}})
    with pytest.raises(ValueError, match="result: no task 99"):
        tuner.tell({**result, "task": 99})
    with pytest.raises(ValueError, match="task: missing field"):
        own.work({"task": 1})  # type: ignore[typeddict-item]
    assert tuner.tell(result) and not tuner.tell(result)
    assert tuner.progress["done"] == 1 and repr(tuner).startswith("<Tuner: choosing, 1 of")
