"""Scans of a street, made and registered by the program that the module is compared with."""

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import echoloop
import pytest

Run = Callable[..., str]


@pytest.fixture(scope="session")
def run() -> Run:
    """Output of the program ``echoloop`` with these arguments."""
    program = os.environ["ECHOLOOP_PROGRAM"]

    def output(*arguments: str | Path) -> str:
        done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
        assert done.returncode in (0, 1), done.stderr
        return done.stdout

    return output


@pytest.fixture(scope="session")
def files(run: Run, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Files of a target and a source."""
    folder = tmp_path_factory.mktemp("street")
    grid = ["scanner.pattern=grid", "scanner.columns=600", "scanner.rows=40"]
    small = [*grid, "scanner.azimuth_deg=360"]
    few = ["scene.towns=[7]", "data.train_pairs=1", "data.test_pairs=1"]
    sets = [part for key in [*small, *few] for part in ("--set", key)]
    run("pairs", "--quiet", "--scene", "structured", *sets, "--output", folder / "pairs")
    first, second = sorted((folder / "pairs").rglob("*.ply"))[:2]
    return first, second


@pytest.fixture(scope="session")
def clouds(files: tuple[Path, Path]) -> tuple[echoloop.Cloud, echoloop.Cloud]:
    """The same, read."""
    target, source = files
    return echoloop.read_cloud(target), echoloop.read_cloud(source)


@pytest.fixture(scope="session")
def registered(run: Run, files: tuple[Path, Path]) -> Callable[..., dict[str, object]]:
    """What ``echoloop register`` says of both with these flags."""
    target, source = files

    def document(*flags: str) -> dict[str, object]:
        told: dict[str, object] = json.loads(run("register", "--json", "-q", target, source, *flags))
        return told

    return document
