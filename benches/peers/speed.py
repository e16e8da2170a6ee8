"""Times every stage of every contestant on one number of threads, taking turns, and writes JSON.

A round runs each stage once for everybody, so that what else the machine does falls on all alike. The first round warms up;
what takes more than ten seconds in it runs but once more. One thread stays on the last core.

The street's truth is good to 5 cm and 0.5°, and is small_gicp's own: its GICP at 0.1 m comes within 0.2 mm of it. Errors below
that say nothing there. The town's truth is exact.
"""

import argparse
import json
import os
import sys
from pathlib import Path

import numpy as np

STAGES = ["voxel", "normals", "fpfh", "describe", "match", "icp_align", "icp", "gicp_align", "gicp"]
STAGES += ["fgr_solve", "mac_solve", "fgr", "mac", "fgr_refined", "mac_refined", "fgr_gicp", "mac_gicp", "fgr_suggested", "mac_suggested"]
OURS = "Echoloop"
STREET = "street (small_gicp's)"
LONG_MS = 10_000


def pin(threads):
    """Restricts this process and its children to a number of cores."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-threads:])


def town(folder, grid=None):
    """The town pair: two scans of a street 5 m apart, with 122,000 points, or of a grid of columns and rings."""
    from common import PairFiles, offset, write_ply
    from scenes import beams, make_pair

    source, target, truth = make_pair("structured", directions=grid and beams(*grid))
    folder.mkdir(parents=True, exist_ok=True)
    name = "_".join(map(str, ("town", *(grid or ()))))
    files = PairFiles("town", folder / f"{name}_target.ply", folder / f"{name}_source.ply", truth, truth @ offset())
    write_ply(files.target, target)
    write_ply(files.source, source)
    return files


def street(data):
    """small_gicp's own pair; None without the data."""
    from common import PairFiles

    folder = data / "pair_small_gicp" if data else None
    if folder is None or not folder.is_dir():
        where = f"{data} has no pair_small_gicp" if data else "ECHOLOOP_DATA is unset"
        print(f"skipped: small_gicp's pair: {where}", file=sys.stderr)
        return None
    truth = np.loadtxt(folder / "T_target_source.txt")
    return PairFiles(STREET, folder / "target.ply", folder / "source.ply", truth, np.eye(4))


def measure(ours, files, voxel_m, threads, repeats, stages=STAGES, without=(), warm_up=1):
    """Rows of one pair at one voxel, after warm-up rounds; `without` names the (stage, peer) left out."""
    from others import Others

    ours.load(files.target, files.source, voxel_m, files.initial)
    others = Others(*files.clouds(), voxel_m, files.initial, threads)
    runs, long = {}, set()
    for turn in range(warm_up + repeats):
        for stage in stages:
            peers = [peer for peer in others.rows.get(stage, {}) if (stage, peer) not in without]
            contestants = {peer: lambda p=peer: others.run(stage, p) for peer in peers}
            contestants[OURS] = lambda: ours.run(stage)
            for who, work in contestants.items():
                if (stage, who) in long and runs.get((stage, who)):
                    continue
                took = work()
                if took is not None and took.wall_ms > LONG_MS:
                    long.add((stage, who))
                if took is not None and turn >= warm_up:
                    runs.setdefault((stage, who), []).append(took)
    return [row(files, voxel_m, threads, *key, took) for key, took in runs.items()]


def row(files, voxel_m, threads, stage, who, runs):
    """Medians of a stage's runs."""
    from common import errors, median

    wrong = [errors(run.pose, files.truth) for run in runs if run.pose is not None]
    return {
        "pair": files.name,
        "voxel_m": voxel_m,
        "threads": threads,
        "stage": stage,
        "who": who,
        "n_in": runs[0].n_in,
        "n_out": runs[0].n_out,
        "cpu_ms": median(run.cpu_ms for run in runs),
        "wall_ms": median(run.wall_ms for run in runs),
        "translation_m": median(error[0] for error in wrong) if wrong else None,
        "rotation_deg": median(error[1] for error in wrong) if wrong else None,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    ours = parser.add_mutually_exclusive_group(required=True)
    ours.add_argument("--stages", help="our example, built")
    ours.add_argument("--module", action="store_true", help="our module for Python, in this process")
    parser.add_argument("--work", type=Path, required=True, help="folder for the clouds")
    parser.add_argument("--data", type=Path, help="ECHOLOOP_DATA")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--voxels", type=float, nargs="+", default=[0.3, 0.1])
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    pin(args.threads)
    if args.module:
        from module import STAGES as stages
        from module import Module, overhead

        ours, more = Module(), {"overhead": overhead()}
    else:
        from ours import Ours

        ours, more, stages = Ours(args.stages, args.threads), {}, STAGES
    rows = []
    for files in filter(None, [street(args.data), town(args.work)]):
        for voxel_m in args.voxels:
            print(f"{files.name}, voxel {voxel_m} m, {args.threads} thread(s)", file=sys.stderr)
            rows += measure(ours, files, voxel_m, args.threads, args.repeats, stages)
    ours.close()
    args.out.write_text(json.dumps({"repeats": args.repeats, "rows": rows, **more}, indent=1))


if __name__ == "__main__":
    main()
