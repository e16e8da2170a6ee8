"""How costs grow from 5,000 to a million points: one street scanned densely, thinned by ever finer voxels, one thread.

Up to 200,000 points are left of a scan of a million, more of one of five million: voxels cost what they read. Radii are
multiples of the voxel, so that neighbourhoods hold as many points at every size. What takes 15 s at one size is left out of
the larger ones. From 50,000 points on, each is one run that nothing warmed up: on a machine that others use, good to a third.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np

from speed import measure, pin, town

SIZES = [5_000, 10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000]
STAGES = ["voxel", "normals", "fpfh", "describe", "match", "icp", "gicp", "fgr_solve", "mac_solve", "fgr", "mac"]
WITHOUT = {("fgr", "Open3D"), ("voxel", "Open3D tensor"), ("normals", "Open3D tensor")}
ONCE_FROM = 50_000  # a round takes minutes, and its noise is small beside it
TOO_LONG_MS = 15_000
MOST_OF_A_MILLION = 200_000  # finer voxels of that scan would hold a point each


def dense_town(folder, size):
    """The town pair scanned with 128 rings of 8192 beams, or 320 of 16384 if that is too few."""
    return town(folder, (8192, 128) if size <= MOST_OF_A_MILLION else (16384, 320))


def voxel_for(points, size):
    """Edge of the voxels, m, that leaves about this many points."""
    low, high = 0.005, 5.0
    for _ in range(20):
        edge = np.sqrt(low * high)
        cells = np.floor(points / edge).astype(np.int64) + (1 << 20)
        many = len(np.unique(cells[:, 0] << 42 | cells[:, 1] << 21 | cells[:, 2]))
        low, high = (edge, high) if many > size else (low, edge)
    return float(np.sqrt(low * high))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stages", required=True, help="our example, built")
    parser.add_argument("--work", type=Path, required=True, help="folder for the clouds")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    pin(1)
    from ours import Ours

    ours, rows, without = Ours(args.stages, 1), [], set(WITHOUT)
    for size in args.sizes:
        files = dense_town(args.work, size)
        points, _ = files.clouds()
        voxel_m = voxel_for(points, size)
        print(f"{size} points, voxel {voxel_m:.3f} m", file=sys.stderr)
        rounds = (args.repeats, 1) if size < ONCE_FROM else (1, 0)
        measured = measure(ours, files, voxel_m, 1, rounds[0], STAGES, without, warm_up=rounds[1])
        rows += [{**row, "size": size} for row in measured]
        without |= {(row["stage"], row["who"]) for row in measured if row["wall_ms"] > TOO_LONG_MS}
        args.out.write_text(json.dumps({"repeats": args.repeats, "rows": rows}, indent=1))
    ours.close()


if __name__ == "__main__":
    main()
