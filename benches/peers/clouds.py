"""Our clouds in Open3D: every attribute of PLY and PCD, and Open3D's files in ours. A check, no table.

What is compared with: numpy, told by the file's own header, and what the scanner's grid says of ring, column and time.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

COLUMNS, ROWS, DURATION_S = 192, 64, 0.1
SETTINGS = ["scanner.pattern=grid", "scanner.azimuth_deg=180", "scanner.elevation_deg=180", f"scanner.columns={COLUMNS}"]
SETTINGS += [f"scanner.rows={ROWS}", f"motion.duration_s={DURATION_S}", "lidar.echoes=4", "data.baseline_m=1"]
SETTINGS += ["data.train_pairs=1", "data.test_pairs=1"]
ATTRIBUTES = "range_sd intensity reflectivity snr pulse_width flags ring column echo time".split()
PLY_TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1", "uint16": "<u2"}


def header(data, end):
    """Lines of a header, as words, and the data after it."""
    head, body = data.split(end, 1)
    return [line.split() for line in head.decode().splitlines()], body


def read_ply(path):
    """Vertices of our PLY file, read by its header alone."""
    lines, body = header(path.read_bytes(), b"end_header\n")
    assert lines[:2] == [["ply"], ["format", "binary_little_endian", "1.0"]], lines
    fields = [(name, PLY_TYPES[kind]) for first, kind, name in (line for line in lines if line[0] == "property")]
    count = next(int(line[2]) for line in lines if line[0] == "element")
    return np.frombuffer(body, fields, count)


def read_pcd(path):
    """Points of our PCD file, read by its header alone."""
    lines, body = header(path.read_bytes(), b"DATA binary\n")
    entry = {line[0]: line[1:] for line in lines if line[0] != "#"}
    assert entry["COUNT"] == ["1"] * len(entry["FIELDS"]) and entry["HEIGHT"] == ["1"], entry
    kinds = ["<" + kind.lower() + size for kind, size in zip(entry["TYPE"], entry["SIZE"])]
    return np.frombuffer(body, list(zip(entry["FIELDS"], kinds)), int(entry["POINTS"][0]))


def places(points):
    """Coordinates x, y, z of the points."""
    return np.stack([points[axis] for axis in "xyz"], axis=1)


def same(what, found, expected):
    """Asserts that two arrays have the same type and bits."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.dtype == expected.dtype, f"{what}: {found.dtype} instead of {expected.dtype}"
    assert found.shape == expected.shape, f"{what}: {found.shape} instead of {expected.shape}"
    differ = np.flatnonzero(found.reshape(-1) != expected.reshape(-1))
    assert not len(differ), f"{what}: {len(differ)} numbers differ, the first is {differ[0]}"


def check_scan(points):
    """Checks properties of a scan's attributes that hold for any scene."""
    assert list(points.dtype.names) == ["x", "y", "z", *ATTRIBUTES], points.dtype.names
    ring, column, at = points["ring"].astype(float), points["column"].astype(float), places(points).astype(float)
    azimuth, elevation = (column + 0.5) * np.pi / COLUMNS - np.pi / 2, (ring + 0.5) * np.pi / ROWS - np.pi / 2
    beam = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], 1)
    ranges = np.linalg.norm(at, axis=1)
    assert np.abs(at / ranges[:, None] - beam).max() < 1e-5, "a point lies on its beam"
    number = column * ROWS + ring
    assert np.allclose(points["time"], (number + 0.5) * DURATION_S / (COLUMNS * ROWS), rtol=1e-6), "beams in turn"
    order = np.lexsort((points["echo"], number))
    new = np.diff(number[order], prepend=-1) != 0
    echo, along = points["echo"][order].astype(int), ranges[order]
    assert (echo[new] == 0).all() and (np.diff(echo)[~new[1:]] == 1).all(), "echoes are counted from 0"
    assert (np.diff(along)[~new[1:]] >= 0).all() and echo.max() > 0, "by range, and some beam has two"
    assert (points["flags"] < 32).all() and (points["intensity"] > 0).all() and (points["pulse_width"] > 0).all()
    assert (points["range_sd"] > 0).all() and (points["range_sd"] < 0.256).all() and (points["snr"] > 1).all()
    assert (points["reflectivity"] >= 0).all() and 0.05 < np.median(points["reflectivity"]) < 1


def check_open3d(o3d, path, points):
    """Checks that Open3D reads the same values, in the types of the file."""
    cloud = o3d.t.io.read_point_cloud(str(path)).point
    same(f"{path.name} positions", cloud.positions.numpy(), places(points))
    others = set(points.dtype.names) - set("xyz")
    assert set(cloud) == {"positions", *others}, f"{path.name}: {sorted(cloud)}"
    for name in others:
        same(f"{path.name} {name}", cloud[name].numpy()[:, 0], points[name])
    legacy = np.asarray(o3d.io.read_point_cloud(str(path)).points)
    same(f"{path.name} legacy", legacy, places(points).astype(float))
    print(f"{path.name}: {len(points)} points, {len(others)} attributes as written")


def check_register(o3d, run, target, source):
    """Checks that `register` reads Open3D's files, and Open3D the registered cloud, with every attribute."""

    def register(a, b, *more):
        return json.loads(run("register", "-q", "--json", "--method", "icp", a, b, *more))["target_from_source"]

    clouds = [o3d.t.io.read_point_cloud(str(path)) for path in (target, source)]
    found = register(target, source, "-o", target.with_name("moved.pcd"))
    for name, options in [("ascii", {"write_ascii": True}), ("binary", {}), ("compressed", {"compressed": True})]:
        theirs = [target.with_name(f"open3d_{name}_{end}.pcd") for end in ("target", "source")]
        for path, cloud in zip(theirs, clouds):
            assert o3d.t.io.write_point_cloud(str(path), cloud, **options)
        again = register(*theirs)
        difference = np.abs(np.array(again) - np.array(found)).max()
        assert difference <= (1e-4 if name == "ascii" else 0), f"{name}: {difference}"
        print(f"Open3D's {name} PCD registers to the same motion")
    pose, before, moved = np.array(found), read_ply(source), read_pcd(target.with_name("moved.pcd"))
    expected = places(before).astype(float) @ pose[:3, :3].T + pose[:3, 3]
    assert np.abs(places(moved) - expected).max() < 1e-4, "the source in the target's frame"
    for name in ATTRIBUTES:
        same(f"moved {name}", moved[name], before[name])
    check_open3d(o3d, target.with_name("moved.pcd"), moved)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--echoloop", type=Path, required=True, help="our command, built")
    parser.add_argument("--work", type=Path, required=True, help="folder for clouds")
    args = parser.parse_args()
    try:
        import open3d as o3d
    except ImportError as error:
        sys.exit(f"SKIPPED: clouds were not read back: {error}")
    args.work.mkdir(parents=True, exist_ok=True)
    for old in [*args.work.glob("*.ply"), *args.work.glob("*.pcd")]:
        old.unlink()

    def run(*words):
        return subprocess.run([args.echoloop, *words], check=True, stdout=subprocess.PIPE, text=True).stdout

    settings = [word for setting in SETTINGS for word in ("--set", setting)]
    scans = {}
    for kind, read in [("ply", read_ply), ("pcd", read_pcd)]:
        path = args.work / f"scan.{kind}"
        run("scan", "-q", *settings, "-o", path)
        scans[kind] = read(path)
        check_scan(scans[kind])
        check_open3d(o3d, path, scans[kind])
    assert scans["ply"].tobytes() == scans["pcd"].tobytes(), "PLY and PCD hold the same"
    pairs = args.work / "pairs"
    subprocess.run(["rm", "-rf", pairs], check=True)
    run("pairs", "-q", *settings, "-o", pairs)
    check_register(o3d, run, *(pairs / f"000_{end}.ply" for end in ("target", "source")))


if __name__ == "__main__":
    main()
