"""`auto` beside what users of the peers call, from clouds to motion: CPU time and error on folders of pairs.

Folders are those of `echoloop pairs`, or of pairs laid out alike. `--town COLUMNS RINGS` adds the town pair, scanned with
so many beams. KISS-Matcher is followed by small_gicp's GICP; small_gicp and Open3D alone are local and start 0.6 m and 2.9°
off the truth. One thread, all in turns, the least of the rounds; errors are means of motions within 0.5 m, with the rest.
"""

import argparse
import json
from collections import defaultdict
from pathlib import Path

import numpy as np

from common import PairFiles, errors, offset
from speed import pin, town

WRONG_M = 0.5
KISS_VOXELS_M = [0.3, 0.5]
LOCAL_VOXEL_M = 0.25


def of_folder(folder):
    """The pairs of a folder."""
    for pair in json.loads((folder / "pairs.json").read_text())["pairs"]:
        name = pair["name"]
        truth = np.loadtxt(folder / f"{name}_target_from_source.txt").reshape(-1, 4)
        truth = np.vstack([truth[:3], [0, 0, 0, 1]])
        paths = [folder / pair.get(cloud, f"{name}_{cloud}.ply") for cloud in ("target", "source")]
        yield PairFiles(folder.name, *paths, truth, truth @ offset())


def measure(ours, files, rounds):
    """Least CPU time, ms, and error, m, of each contestant."""
    from others import Others, kiss_gicp

    source, target = files.clouds()
    ours.load(files.target, files.source, LOCAL_VOXEL_M)
    others = Others(source, target, LOCAL_VOXEL_M, files.initial, 1)
    for voxel_m in KISS_VOXELS_M:
        others.rows[f"kiss {voxel_m}"] = {"GICP": lambda voxel_m=voxel_m: kiss_gicp(source, target, voxel_m)}
    runs = {"auto": lambda: ours.run("auto_suggested")}
    for stage, peer in [*((f"kiss {v}", "GICP") for v in KISS_VOXELS_M), ("gicp", "small_gicp"), ("icp", "Open3D")]:
        runs[f"{peer} {stage}"] = lambda stage=stage, peer=peer: others.run(stage, peer)
    took = defaultdict(list)
    for _ in range(rounds):
        for who, run in runs.items():
            took[who].append(run())
    least = {}
    for who, runs_of in took.items():
        failed = any(run is None or run.pose is None for run in runs_of)
        error_m = np.inf if failed else errors(runs_of[-1].pose, files.truth)[0]
        least[who] = np.nan if failed else min(run.cpu_ms for run in runs_of), error_m
    return len(source), least


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stages", required=True, help="our benches/stages, built")
    parser.add_argument("--work", type=Path, required=True, help="folder for the town's clouds")
    parser.add_argument("--town", type=int, nargs=2, action="append", default=[], metavar=("COLUMNS", "RINGS"))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("folders", type=Path, nargs="*")
    args = parser.parse_args()
    pin(1)
    from ours import Ours

    ours = Ours(args.stages, 1)
    groups = [(folder.name, list(of_folder(folder))) for folder in args.folders]
    groups += [(f"town, {c} × {r}", [town(args.work, (c, r))]) for c, r in args.town]
    for number, (name, pairs) in enumerate(groups):
        measured = [measure(ours, files, args.rounds) for files in pairs]
        if number == 0:
            print("| pairs | points |", " | ".join(measured[0][1]), "|")
            print("|---|---|" + "---|" * len(measured[0][1]))
        cells = []
        for who in measured[0][1]:
            times_ms, errors_m = zip(*(row[who] for _, row in measured))
            right = [error for error in errors_m if error < WRONG_M]
            wrong = f", {len(errors_m) - len(right)} of {len(errors_m)} wrong" if len(right) < len(errors_m) else ""
            mean_cm = f"{100 * np.mean(right):.2f} cm" if right else "–"
            cells.append(f"{np.mean(times_ms):,.0f} ms, {mean_cm}{wrong}")
        print(f"| {name} | {np.mean([points for points, _ in measured]):,.0f} |", " | ".join(cells), "|", flush=True)
    ours.close()


if __name__ == "__main__":
    main()
