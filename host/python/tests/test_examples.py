"""The examples run as their first lines say."""

import re
import subprocess
import sys
from pathlib import Path

import echoloop

EXAMPLES = Path(__file__).parents[1] / "examples"


def output(name: str, *arguments: str | Path) -> str:
    command = [sys.executable, str(EXAMPLES / name), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_two_scans_are_registered_and_drawn(files: tuple[Path, Path], tmp_path: Path) -> None:
    picture = tmp_path / "scans.png"
    said = output("register_two_scans.py", *files, "--plot", picture)
    assert "converged" in said and "standard deviations, mrad" in said
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_open3d_and_small_gicp_go_on_from_what_is_found(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    both = tmp_path / "both.ply"
    said = output("beside_open3d_and_small_gicp.py", *files, "--output", both)
    apart_cm = re.findall(r"(?:GICP|ICP): (\d+\.\d) cm", said)
    assert "converged" in said and len(apart_cm) == 2
    assert all(float(cm) < 30 for cm in apart_cm), said
    clouds = [echoloop.read_cloud(path) for path in (*files, both)]
    assert len(clouds[2]) == len(clouds[0]) + len(clouds[1])


def test_waveforms_become_echoes(tmp_path: Path) -> None:
    picture = tmp_path / "echoes.png"
    said = output("waveforms_to_echoes.py", "--plot", picture)
    assert said.startswith("100 echoes in 50 waveforms")
    assert "200.0" in said and picture.read_bytes().startswith(b"\x89PNG")


def test_optuna_tunes_the_loop() -> None:
    small = ["scanner.pattern=grid", "scanner.columns=60", "scanner.rows=12", "scene.towns=[5]",
             "data.train_pairs=1", "data.test_pairs=1"]
    said = output("tune_with_optuna.py", "--trials", "3", *(f"--set={key}" for key in small))
    assert "start: recall" in said and "tuned: recall" in said
    assert '"lidar.power"' in said
