"""Recall of global methods on pairs made to be hard: `echoloop pairs`, every method on the same files.

Three kinds of place, 5 to 20 m apart, headings within ±20° (a scanner of ±90° × ±90°) or unknown (as dense, all
around); 49,000 beams in the half circle, or a quarter, which is the paper's scanner with its 8,000 points.

A pair counts if its scans overlap by 30 %: so many points of the one, thinned to 0.5 m, have a point of the other within
1 m under the true motion, in the mean over both; of the full scans, for both densities. Without thinning, half of a scan's
points would be those at the sensor's foot, which a scan 10 m ahead never sees. The bound was set before any method of
ours had run. Success is 1 m and 5°. Ours run with the default settings of the voxel, and with those that `Suggestions`
makes of the clouds; none were tuned on these towns.

Ours also say whether they found anything: `converged` is yes. To see what that is worth, they register the source of a cell's last
pair to the target of its first as well, which stand in different towns.
"""

import argparse
import itertools
import json
import multiprocessing
import subprocess
import sys
from pathlib import Path

import numpy as np

KINDS = ["structured", "semi-structured", "unstructured"]
BASELINES_M = [5, 10, 15, 20]
HEADINGS_DEG = [20, 180]
SCANNERS = {"full": (384, 128), "quarter": (192, 64)}  # columns in 180°, rows
VOXELS_M = [0.3, 0.5, 0.8, 1.2]
PAIRS_A_TOWN, MOST_TOWNS = 2, 10
THIN_M, NEAR_M, LEAST_OVERLAP = 0.5, 1.0, 0.3
SUCCESS_M, SUCCESS_DEG = 1.0, 5.0
OURS = {
    "fgr": "Echoloop FGR",
    "fgr_refined": "Echoloop FGR + ICP",
    "fgr_gicp": "Echoloop FGR + GICP",
    "mac": "Echoloop MAC",
    "mac_refined": "Echoloop MAC + ICP",
    "mac_gicp": "Echoloop MAC + GICP",
}
SUGGESTED = {
    "fgr_suggested": "Echoloop FGR + ICP",
    "mac_suggested": "Echoloop MAC + ICP",
    "auto_suggested": "Echoloop auto",
}


def make(args, folder, kind, town, baseline_m, heading_deg, scanner):
    """Writes a town's pairs once; False when it has no such pairs."""
    if (folder / "pairs.json").is_file():
        return True
    columns, rows = SCANNERS[scanner]
    halves = 1 if heading_deg < 90 else 2  # of the way round
    settings = {
        "scene.towns": [town],
        "data.train_pairs": 1,
        "data.test_pairs": PAIRS_A_TOWN,
        "data.baseline_m": baseline_m,
        "data.heading_range_deg": heading_deg,
        "scanner.pattern": "grid",
        "scanner.columns": columns * halves,
        "scanner.rows": rows,
        "scanner.azimuth_deg": 180 * halves,
    }
    command = [args.echoloop, "pairs", "-q", "--threads", "1", "--scene", kind, "-o", str(folder)]
    command += ["--seed", str(args.seed)]
    command += [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    folder.parent.mkdir(parents=True, exist_ok=True)
    made = subprocess.run(command, capture_output=True, text=True)
    if made.returncode != 0:
        print(f"skipped: {folder.name}: {made.stderr.strip()}", file=sys.stderr)
    return made.returncode == 0


def pairs(args, kind, baseline_m, heading_deg, scanner):
    """Files of a cell's pairs, from as many towns as needed; the poses do not depend on the scanner."""
    from common import PairFiles

    found = []
    for town in range(args.first_town, args.first_town + MOST_TOWNS):
        if len(found) >= args.pairs:
            break
        folder = args.work / f"{kind}-{town}_{baseline_m:g}m_{heading_deg:g}deg_{scanner}"
        if not make(args, folder, kind, town, baseline_m, heading_deg, scanner):
            continue
        for entry in json.loads((folder / "pairs.json").read_text())["pairs"]:
            number = entry["name"]
            truth = np.loadtxt(folder / f"{number}_target_from_source.txt")
            clouds = (folder / f"{number}_{end}.ply" for end in ("target", "source"))
            found.append(PairFiles(f"{town}-{number}", *clouds, truth, np.eye(4)))
    return found[: args.pairs]


def thinned(points):
    """First point of each cell."""
    _, first = np.unique(np.floor(points / THIN_M).astype(np.int64), axis=0, return_index=True)
    return points[first]


def overlap(target, source, truth):
    """Share of a scan's cells that are near a cell of the other under the true motion, mean of both scans."""
    from scipy.spatial import cKDTree

    target, source = thinned(target), thinned(source @ truth[:3, :3].T + truth[:3, 3])
    shares = (cKDTree(b).query(a)[0] <= NEAR_M for a, b in ((target, source), (source, target)))
    return float(np.mean([share.mean() for share in shares]))


def contestants(ours, files, alone):
    """Functions that run each method at a voxel and return a `Took` or None; only ours if asked."""

    def run_ours(stage, voxel_m):
        ours.load(files.target, files.source, voxel_m)
        return ours.run(stage)

    for stage, name in OURS.items():
        yield name, lambda voxel_m, stage=stage: run_ours(stage, voxel_m)
    if alone:
        return
    import others
    from common import clocked

    source, target = files.clouds()
    theirs = {
        "KISS-Matcher": lambda voxel_m: others.kiss(source, target, voxel_m),
        "KISS-Matcher + GICP": lambda voxel_m: others.kiss_gicp(source, target, voxel_m),
        "Open3D FGR": lambda voxel_m: (0, others.fgr_default(source, target, voxel_m)),
        "Open3D FGR tuned": lambda voxel_m: (0, others.fgr_tuned(source, target, voxel_m)),
    }
    for name, work in theirs.items():
        yield name, lambda voxel_m, work=work: clocked(lambda: work(voxel_m), len(source))


def town_of(files):
    """Number of a town."""
    return files.name.split("-")[0]


def registered(pair, who, voxel_m, took, truth):
    """Row of one run; None when it failed."""
    from common import errors

    if took is None:
        return []
    row = {**pair, "who": who, "voxel_m": voxel_m, "cpu_ms": took.cpu_ms, "stop": took.stop}
    if truth is not None:
        metres, degrees = errors(took.pose, truth)
        row |= {"translation_m": metres, "rotation_deg": degrees}
        row["success"] = metres <= SUCCESS_M and degrees <= SUCCESS_DEG
    return [row]


def is_theirs(row):
    """True for a peer's run."""
    return "who" in row and not row["who"].startswith("Echoloop")


def judge(task):
    """Rows of one cell."""
    from common import PairFiles, read_ply
    from ours import Ours

    args, kind, baseline_m, heading_deg = task
    shares, rows, ours = {}, [], Ours(args.stages, 1)
    for scanner in SCANNERS:
        cell = pairs(args, kind, baseline_m, heading_deg, scanner)
        for files in cell:
            if scanner == "full":
                shares[files.name] = overlap(read_ply(files.target), read_ply(files.source), files.truth)
            pair = {"kind": kind, "baseline_m": baseline_m, "heading_deg": heading_deg, "scanner": scanner}
            pair |= {"pair": files.name, "overlap": shares[files.name]}
            if pair["overlap"] < LEAST_OVERLAP:
                rows.append(pair)
                continue
            for voxel_m, (who, work) in itertools.product(args.voxels, contestants(ours, files, args.ours)):
                rows += registered(pair, who, voxel_m, work(voxel_m), files.truth)
            ours.load(files.target, files.source, args.voxels[0])
            for stage, who in SUGGESTED.items():
                rows += registered(pair, who, "suggested", ours.run(stage), files.truth)
        if len(cell) > 1 and town_of(cell[0]) != town_of(cell[-1]):
            pair = {"kind": kind, "baseline_m": baseline_m, "heading_deg": heading_deg, "scanner": scanner}
            pair |= {"pair": f"{cell[0].name} and {cell[-1].name}", "unrelated": True}
            files = PairFiles(pair["pair"], cell[0].target, cell[-1].source, None, np.eye(4))
            for voxel_m, stage in itertools.product(args.voxels, OURS):
                ours.load(files.target, files.source, voxel_m)
                rows += registered(pair, OURS[stage], voxel_m, ours.run(stage), None)
            for stage, who in SUGGESTED.items():
                rows += registered(pair, who, "suggested", ours.run(stage), None)
    ours.close()
    print(f"judged {kind}, {baseline_m:g} m, ±{heading_deg:g}°", file=sys.stderr)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stages", required=True, help="our example, built")
    parser.add_argument("--echoloop", required=True, help="our command, built")
    parser.add_argument("--work", type=Path, required=True, help="folder for the pairs")
    parser.add_argument("--pairs", type=int, default=4, help="pairs a cell")
    parser.add_argument("--kinds", nargs="+", default=KINDS)
    parser.add_argument("--baselines", type=float, nargs="+", default=BASELINES_M)
    parser.add_argument("--headings", type=float, nargs="+", default=HEADINGS_DEG)
    parser.add_argument("--voxels", type=float, nargs="+", default=VOXELS_M)
    parser.add_argument("--ours", action="store_true", help="ours anew; the peers' rows stay as they were measured")
    parser.add_argument("--first-town", type=int, default=1, help="towns from this number on")
    parser.add_argument("--seed", type=int, default=1, help="of the pairs' viewpoints and noise; a --work of its own")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    # The kinds take turns and results are kept: a run that is stopped is a smaller one, not a lost one.
    cells = itertools.product(args.baselines, args.headings, args.kinds)
    tasks = [(args, kind, baseline_m, heading_deg) for baseline_m, heading_deg, kind in cells]
    kept = args.ours and args.out.is_file()
    done = [row for row in json.loads(args.out.read_text())["rows"] if is_theirs(row)] if kept else []
    with multiprocessing.get_context("spawn").Pool(args.jobs) as pool:
        for rows in pool.imap(judge, tasks):
            done += rows
            args.out.write_text(json.dumps({"pairs": args.pairs, "rows": done}, indent=1))


if __name__ == "__main__":
    main()
