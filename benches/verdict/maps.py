"""Pairs of a map and a scan: a scan on its map, a model on its scan, an object in its scene.

usage: maps.py ECHOLOOP OUTPUT KIND PATTERN SCANS FIRST COUNT

makes OUTPUT, a folder as `echoloop pairs` makes them, with COUNT pairs FIRST, FIRST + 1, ..., each
in a town of its own that its number decides. Needs NumPy. KIND is one of

map-structured, map-semi-structured, map-unstructured: the target is a map, merged from SCANS scans
    along a way; the source is one more scan, 1 to 8 m beside it, with any heading (of a sensor with
    a narrow field of view: with about that of the way). The map's frame is, in turn, that of its
    first scan, one whose origin no sensor stood at, and a level one about the map's centroid
object: the target is such a map, the source a piece of one scan, 6 to 15 m wide, about its centre
model: the target is one scan, the source a piece of a dense map of SCANS clean scans, 8 to 20 m
    wide, about its centre; of odd numbers without its ground
stranger-map: the map is of one town and the scan of another; the truth is out of reach
"""

import math
import os
import random
import subprocess
import sys
import tempfile

import numpy as np

from extruded import PATTERNS, write_motion, write_pairs

TOWNS = ("structured", "semi-structured", "unstructured")
NARROW = ("livox-mid-40",)
HEIGHT_M = 2.0
VOXEL_M = 0.1
# Few beams where poses are all that is asked for, many of little noise for a model.
COARSE = ["scanner.pattern=grid", "scanner.columns=16", "scanner.rows=8", "scanner.azimuth_deg=360"]
CLEAN = ["scanner.pattern=grid", "scanner.columns=768", "scanner.rows=96", "scanner.azimuth_deg=360", "lidar.shots=4"]


def pose(place, yaw, pitch=0.0, roll=0.0):
    """The 4 x 4 matrix of a place x y z and Rz(yaw) Ry(pitch) Rx(roll)."""
    cy, sy, cp, sp, cr, sr = (f(a) for a in (yaw, pitch, roll) for f in (math.cos, math.sin))
    matrix = np.eye(4)
    matrix[:3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, place[0]],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, place[1]],
        [-sp, cp * sr, cp * cr, place[2]],
    ]
    return matrix


def inverse(matrix):
    turned_back = np.eye(4)
    turned_back[:3, :3] = matrix[:3, :3].T
    turned_back[:3, 3] = -matrix[:3, :3].T @ matrix[:3, 3]
    return turned_back


def moved(matrix, points):
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def read_points(path):
    """x y z of a binary PLY of one element."""
    kinds = {"float": "<f4", "uchar": "u1", "uint16": "<u2", "ushort": "<u2", "uint": "<u4"}
    with open(path, "rb") as file:
        fields, count = [], 0
        while (words := file.readline().decode().split()) != ["end_header"]:
            if words[0] == "element":
                count = int(words[2])
            elif words[0] == "property":
                fields.append((words[2], kinds[words[1]]))
        rows = np.frombuffer(file.read(), np.dtype(fields), count)
    return np.stack([rows[axis] for axis in "xyz"], axis=1).astype(float)


def write_points(path, points):
    with open(path, "wb") as file:
        header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
        header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
        file.write(header.encode() + points.astype("<f4").tobytes())


def voxels(points, size_m):
    """A whole number for the voxel of each point within 50 km."""
    x, y, z = (np.floor(points / size_m).astype(np.int64) + (1 << 20)).T
    return (x << 42) | (y << 21) | z


def thinned(points):
    """The first point of each voxel, in the order of the points."""
    return points[np.sort(np.unique(voxels(points, VOXEL_M), return_index=True)[1])]


def seen_share(part, whole):
    """Share of the voxels of half a metre of one cloud that the other has points in."""
    return np.isin(np.unique(voxels(part, 0.5)), voxels(whole, 0.5)).mean()


def holds_all_directions(points):
    """Whether surfaces face enough ways to leave no direction open, and stand up."""
    if np.ptp(points[:, 2]) < 2.5:
        return False
    _, cells, counts = np.unique(voxels(points, 1.0), return_inverse=True, return_counts=True)
    cells = cells.ravel()
    average = lambda x: np.bincount(cells, x) / counts
    means = np.stack([average(x) for x in points.T], axis=1)
    off = points - means[cells]
    spread = [[average(off[:, i] * off[:, j]) for j in range(3)] for i in range(3)]
    values, axes = np.linalg.eigh(np.moveaxis(np.array(spread), 2, 0)[counts >= 6])
    flat = (values[:, 0] < 0.1 * values[:, 1]) & (values[:, 1] > 1e-3)
    normals = axes[flat, :, 0]
    return len(normals) >= 12 and np.linalg.eigvalsh(normals.T @ normals / len(normals))[0] > 0.08


class Town:
    """A town, and places at which a sensor may stand."""

    def __init__(self, echoloop, kind, number):
        self.echoloop, self.kind, self.number = echoloop, kind, number
        with tempfile.TemporaryDirectory() as folder:
            free = os.path.join(folder, "free")
            drawn = ["data.test_pairs=300", "data.train_pairs=1", "data.baseline_m=3"]
            drawn += ["data.heading_range_deg=180", f"scanner.height_m={HEIGHT_M}"]
            self.run("pairs", free, COARSE + drawn)
            names = sorted(name for name in os.listdir(free) if "_world_from_" in name)
            poses = [np.loadtxt(os.path.join(free, name)) for name in names]
        self.places = np.array([pose[:3, 3] for pose in poses])

    def run(self, what, output, settings, *options):
        command = [self.echoloop, what, "--quiet", "--threads", "1", "--scene", self.kind]
        command += ["--seed", str(self.number + 1), "-o", output, *options]
        for setting in [f"scene.towns=[{self.number}]", *settings]:
            command += ["--set", setting]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)

    def scans(self, poses, settings):
        """The points of a scan from each pose, in the sensor's frame."""
        with tempfile.TemporaryDirectory() as folder:
            way, output = os.path.join(folder, "way.txt"), os.path.join(folder, "scans")
            np.savetxt(way, [pose[:3].ravel() for pose in poses], "%.9f")
            self.run("scan", output, settings, "--trajectory", way)
            path = lambda i: os.path.join(output, f"{i:06}.ply")
            return [read_points(path(i)) for i in range(len(poses))]

    def distances_m(self, place):
        return np.hypot(*(self.places - place)[:, :2].T)

    def way(self, rng, count):
        """Poses, each 2 to 5 m from one before it and ahead of it where there is a place; 2 m from
        any other. Where no way is so long it goes on at the place nearest to it."""
        starts = rng.sample(range(len(self.places)), len(self.places))[:100]
        for start in starts:
            poses = self.way_from(rng, self.places[start], count)
            if len(poses) == count:
                return poses
        return self.way_from(rng, self.places[starts[0]], count, may_jump=True)

    def way_from(self, rng, start, count, may_jump=False):
        poses, back = [tilted(rng, start, rng.uniform(-math.pi, math.pi))], [0]
        is_free = self.distances_m(start) >= 2
        while len(poses) < count and (back or may_jump):
            last = poses[back[-1] if back else -1]
            near = np.flatnonzero(is_free & (self.distances_m(last[:3, 3]) <= 5))
            if not back:
                far_m = np.min([self.distances_m(pose[:3, 3]) for pose in poses], axis=0)
                near = np.array([np.argmin(np.where(is_free, far_m, np.inf))])
            elif not len(near):
                back.pop()
                continue
            ahead = (self.places[near] - last[:3, 3]) @ last[:3, 0]
            place = self.places[near[np.argmax(ahead + [rng.uniform(0, 2) for _ in near])]]
            step = place - last[:3, 3]
            back.append(len(poses))
            poses.append(tilted(rng, place, math.atan2(step[1], step[0]) + rng.uniform(-0.2, 0.2)))
            is_free &= self.distances_m(place) >= 2
        return poses

    def beside(self, rng, poses, is_narrow):
        """A pose 1 to 8 m beside one of these and no nearer to any; None where there is none."""
        for _ in range(200):
            other = rng.choice(poses)
            near = np.min([self.distances_m(pose[:3, 3]) for pose in poses], axis=0) >= 1
            near = np.flatnonzero(near & (self.distances_m(other[:3, 3]) <= 8))
            if len(near):
                heading = math.atan2(other[1, 0], other[0, 0]) + rng.uniform(-0.35, 0.35)
                turn = heading if is_narrow else rng.uniform(-math.pi, math.pi)
                return tilted(rng, self.places[rng.choice(near)], turn)
        return None

    def above_ground(self, points):
        """The points 0.3 m and more above the ground of the four places around each."""
        cells, of_cell = np.unique(np.floor(points[:, :2]), axis=0, return_inverse=True)
        ground = []
        for cell in cells:
            far_m = self.distances_m([*(cell + 0.5), 0]) + 0.1
            near = np.argsort(far_m)[:4]
            ground.append(np.average(self.places[near, 2] - HEIGHT_M, weights=1 / far_m[near]))
        return points[points[:, 2] > np.array(ground)[of_cell.ravel()] + 0.3]


def tilted(rng, place, yaw):
    return pose(place, yaw, rng.uniform(-0.03, 0.03), rng.uniform(-0.03, 0.03))


def merged(poses, scans):
    return np.concatenate([moved(pose, scan) for pose, scan in zip(poses, scans)])


def map_frame(rng, which, first, points):
    """The matrix map_from_world of one of three frames."""
    if which == 0:
        return inverse(first)
    if which == 1:
        away, way = rng.uniform(50, 300), rng.uniform(-math.pi, math.pi)
        place = (away * math.cos(way), away * math.sin(way), rng.uniform(-10, 10))
        return pose(place, rng.uniform(-math.pi, math.pi)) @ inverse(first)
    return pose(-points.mean(axis=0), 0)


def box(rng, points, centre, width_m):
    """The points in a turned box, and the pose of its middle."""
    frame = pose(centre, rng.uniform(-math.pi, math.pi))
    inside = (np.abs(moved(inverse(frame), points)) <= width_m / 2).all(axis=1)
    return points[inside], frame


def scan_on_map(echoloop, rng, town, settings, is_narrow, scans, number):
    """Target, source and target_from_source of a map and of another scan in it."""
    beside = None
    while beside is None:
        way = town.way(rng, scans)
        beside = town.beside(rng, way, is_narrow)
    *parts, source = town.scans([*way, beside], settings)
    world = merged(way, parts)
    map_from_world = map_frame(rng, (number + scans) % 3, way[0], world)
    return thinned(moved(map_from_world, world)), source, map_from_world @ beside


def object_in_scene(echoloop, rng, town, settings, is_narrow, scans, number):
    for _ in range(10):
        target, scan, truth = scan_on_map(echoloop, rng, town, settings, is_narrow, scans, number)
        centres = scan[np.linalg.norm(scan, axis=1) < 20]
        for _ in range(50):
            source, frame = box(rng, scan, rng.choice(centres), rng.uniform(6, 15))
            is_solid = len(source) >= 800 and holds_all_directions(source)
            if is_solid and seen_share(moved(truth, source), target) > 0.6:
                return target, moved(inverse(frame), source), truth @ frame
    raise RuntimeError(f"no object in {town.kind}-{town.number}")


def model_on_scan(echoloop, rng, town, settings, is_narrow, scans, number):
    for _ in range(10):
        (stand,) = town.way(rng, 1)
        (target,) = town.scans([stand], settings)
        near = [i for i in np.argsort(town.distances_m(stand[:3, 3])) if rng.random() < 0.5]
        poses = spread([town.places[i] for i in near[:100]], scans)
        dense = thinned(merged(poses, town.scans(poses, CLEAN)))
        dense = town.above_ground(dense) if number % 2 else dense
        seen, far_m = moved(stand, target), np.linalg.norm(target, axis=1)
        centres = town.above_ground(seen[(far_m > 4) & (far_m < 25)])
        for _ in range(50 if len(centres) else 0):
            source, frame = box(rng, dense, rng.choice(centres), rng.uniform(8, 20))
            is_solid = len(source) >= 2000 and holds_all_directions(source)
            if is_solid and seen_share(source, seen) > 0.3:
                return target, moved(inverse(frame), source), inverse(stand) @ frame
    raise RuntimeError(f"no model in {town.kind}-{town.number}")


def spread(places, count):
    """Poses at `count` of these places, each as far as there is from those before it."""
    chosen = [places[0]]
    while len(chosen) < count:
        far_m = [min(math.dist(place, other) for other in chosen) for place in places]
        chosen.append(places[int(np.argmax(far_m))])
    return [pose(place, 0) for place in chosen]


def scan_on_strange_map(echoloop, rng, town, settings, is_narrow, scans, number):
    target, _, _ = scan_on_map(echoloop, rng, town, settings, is_narrow, scans, number)
    other = Town(echoloop, town.kind, town.number + 50000)
    _, source, _ = scan_on_map(echoloop, rng, other, settings, is_narrow, 1, number)
    return target, source, pose((1e6, 0, 0), 0)


def make(echoloop, folder, name, kind, pattern, scans):
    number = int(name)
    rng = random.Random(f"{kind} {pattern} {scans} {number}")
    makers = {"object": object_in_scene, "model": model_on_scan}
    makers["stranger-map"] = scan_on_strange_map
    towns = TOWNS[:2] if kind == "model" else TOWNS
    which = kind.removeprefix("map-") if kind not in makers else towns[number // 2 % len(towns)]
    town = Town(echoloop, which, 5000 + number)
    drawn = (echoloop, rng, town, PATTERNS[pattern], pattern in NARROW, scans, number)
    target, source, truth = makers.get(kind, scan_on_map)(*drawn)
    path = lambda end: os.path.join(folder, f"{name}_{end}")
    write_points(path("target.ply"), target)
    write_points(path("source.ply"), source)
    write_motion(path("target_from_source.txt"), truth.tolist())


def main():
    echoloop, folder, kind, pattern, scans, first, count = sys.argv[1:]
    write = lambda name: make(echoloop, folder, name, kind, pattern, int(scans))
    write_pairs(folder, first, count, write)


if __name__ == "__main__":
    main()
