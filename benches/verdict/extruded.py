"""Scan pairs in extruded places: tunnels, corridors, highways, fields, with and without features.

usage: extruded.py ECHOLOOP OUTPUT KIND PATTERN FIRST COUNT

makes OUTPUT, a folder as `echoloop pairs` makes them, with COUNT pairs of places FIRST, FIRST + 1,
... of a kind: a section that is drawn by the number, extruded over 400 m and scanned from two poses
0.2 to 6 m apart along it. A kind is a section of SECTIONS, or one with features, as tunnel+niches.
"""

import json
import math
import os
import random
import subprocess
import sys

HALF_LENGTH_M = 200.0
PATTERNS = {
    "grid": ["scanner.pattern=grid", "scanner.columns=512", "scanner.rows=64", "scanner.azimuth_deg=360"],
    "os1-64": ["scanner.pattern=os1-64", "scanner.columns=512"],
    "vlp-16": ["scanner.pattern=vlp-16", "scanner.columns=900"],
    "hdl-64e": ["scanner.pattern=hdl-64e", "scanner.columns=600"],
    "livox-mid-40": ["scanner.pattern=livox-mid-40"],
}


class Mesh:
    """Triangles of one material."""

    def __init__(self):
        self.vertices, self.faces = [], []

    def quad(self, *corners):
        n = len(self.vertices)
        self.vertices += corners
        self.faces += [(n + 1, n + 2, n + 3), (n + 1, n + 3, n + 4)]

    def extrude(self, line, half_m=HALF_LENGTH_M):
        for (y0, z0), (y1, z1) in zip(line, line[1:]):
            self.quad((-half_m, y0, z0), (-half_m, y1, z1), (half_m, y1, z1), (half_m, y0, z0))

    def box(self, x, y, z):
        corner = lambda i: (x[i & 1], y[i >> 1 & 1], z[i >> 2 & 1])
        for face in ("0132", "4576", "0154", "2376", "0264", "1375"):
            face = map(int, face)
            self.quad(*map(corner, face))


def rectangle(w, h):
    return [(-w, h), (-w, 0), (w, 0), (w, h), (-w, h)]


def tunnel(draw, mesh):
    w, h = draw(2.2, 6), draw(3, 7)
    if draw(0, 1) < 0.5:
        mesh.extrude(rectangle(w, h))
    else:
        wall = draw(0.3, 2)
        vault = [math.pi * i / 16 for i in range(1, 17)]
        arch = [(w * math.cos(a), wall + (h - wall) * math.sin(a)) for a in vault]
        mesh.extrude([(-w, 0), (w, 0), (w, wall), *arch, (-w, 0)])
    return w, draw(1.2, 2.2)


def pipe(draw, mesh):
    w = draw(1.5, 4)
    turn = [2 * math.pi * i / 24 for i in range(25)]
    mesh.extrude([(w * math.cos(a), w + w * math.sin(a)) for a in turn])
    return w, draw(0.5, 1) * w


def corridor(draw, mesh):
    w = draw(0.8, 1.8)
    mesh.extrude(rectangle(w, draw(2.3, 3.5)))
    return w, draw(0.4, 1.4)


def highway(draw, mesh):
    w, slope = draw(7, 14), draw(-0.03, 0.03)
    left, right = -1 + draw(-1, 1), -1 + draw(-1, 1)
    verge = [(w, slope * w), (w + 3, slope * w - 0.3)]
    mesh.extrude([(-60, left), (-w - 3, -0.3), (-w, 0), *verge, (60, right)])
    for y in (-w + 0.5, w - 0.5):  # guard rails
        mesh.extrude([(y, 0.45), (y, 0.78)])
        mesh.extrude([(y + 0.1, 0.45), (y + 0.1, 0.78)])
    if draw(0, 1) < 0.3:
        mesh.extrude([(w + 2, -0.3), (w + 2, draw(2, 5))])
    return w - 0.8, draw(1.6, 2.2)


def field(draw, mesh):
    slope = draw(-0.05, 0.05)
    mesh.extrude([(-HALF_LENGTH_M, -slope * HALF_LENGTH_M), (HALF_LENGTH_M, slope * HALF_LENGTH_M)])
    return 30, draw(1.5, 3)


def ditch(draw, mesh):
    w = draw(4, 10)
    bed = [(-w, draw(0, 2)), (-w / 3, -1), (w / 3, -1), (w, draw(0, 2))]
    mesh.extrude([(-60, draw(0, 2)), *bed, (60, draw(0, 3))])
    return w / 3, draw(0.5, 1.2)


def canyon(draw, mesh):
    w, h = draw(5, 12), draw(6, 15)
    kerb = [(-w + 2, 0.15), (-w + 2, 0), (w - 2, 0), (w - 2, 0.15)]
    mesh.extrude([(-w, h), (-w, 0.15), *kerb, (w, 0.15), (w, h)])
    return w, draw(1.6, 2.2)


SECTIONS = {f.__name__: f for f in (tunnel, pipe, corridor, highway, field, ditch, canyon)}


def niches(draw, mesh, w, gap_m):
    """Boxes on both walls, each of its own size."""
    x = -100 + draw(0, gap_m)
    while x < 100:
        side, depth, z = math.copysign(1, draw(-1, 1)), draw(0.25, 0.8), draw(0, 1)
        wall = sorted((side * w, side * (w - depth)))
        mesh.box((x, x + draw(0.4, 1.8)), wall, (z, z + draw(0.5, 2.2)))
        x += draw(0.3, 1.7) * gap_m / 2


def posts(draw, mesh, w, gap_m):
    """Posts beside the way."""
    x = -100 + draw(0, gap_m)
    while x < 100:
        y = math.copysign(1, draw(-1, 1)) * w * draw(0.9, 1.3)
        mesh.box((x, x + 0.25), (y - 0.12, y + 0.12), (-1, draw(3, 7)))
        x += draw(0.4, 1.6) * gap_m


def periodic(draw, mesh, w, gap_m):
    """Pilasters at equal distances."""
    for i in range(int(200 / gap_m)):
        x = -100 + i * gap_m
        for side in (-1, 1):
            mesh.box((x, x + 0.6), sorted((side * w, side * (w - 0.4))), (0, 2.5))


FEATURES = {f.__name__: f for f in (niches, posts, periodic)}


def place(kind, number):
    """The mesh, and two poses x y z yaw pitch roll along it."""
    rng = random.Random(f"{kind} {number}")
    section, _, features = kind.partition("+")
    mesh = Mesh()
    w, z = SECTIONS[section](rng.uniform, mesh)
    if features:
        FEATURES[features](rng.uniform, mesh, w, rng.uniform(6, 25))
    x, y, yaw = rng.uniform(-10, 10), rng.uniform(-0.4, 0.4) * min(w, 10), rng.uniform(-0.3, 0.3)
    along = rng.choice((0.3, 1, 2, 2, 3, 5)) * rng.uniform(0.8, 1.2) * rng.choice((-1, 1))
    aside = rng.uniform(-0.05, 0.05) * min(w, 10)
    turn = (yaw + rng.uniform(-0.12, 0.12), rng.uniform(-0.02, 0.02), rng.uniform(-0.02, 0.02))
    second = (x + along, y + aside, z + rng.uniform(-0.03, 0.03), *turn)
    return mesh, rng.uniform(-math.pi, math.pi), [(x, y, z, yaw, 0, 0), second]


def quaternion(yaw, pitch, roll):
    cy, sy, cp, sp, cr, sr = (f(a / 2) for a in (yaw, pitch, roll) for f in (math.cos, math.sin))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def relative(first, second):
    """The 4 x 4 matrix target_from_source of two rows of KITTI's twelve numbers."""
    at = lambda pose, i, j: pose[4 * i + j]
    rows = []
    for i in range(3):
        row = [sum(at(first, k, i) * at(second, k, j) for k in range(3)) for j in range(3)]
        row.append(sum(at(first, k, i) * (at(second, k, 3) - at(first, k, 3)) for k in range(3)))
        rows.append(row)
    return rows + [[0, 0, 0, 1]]


def scan(echoloop, folder, name, kind, pattern, number):
    mesh, turn, poses = place(kind, number)
    c, s = math.cos(turn), math.sin(turn)
    turned = lambda p: (c * p[0] - s * p[1], s * p[0] + c * p[1], p[2])
    path = lambda end: os.path.join(folder, f"{name}_{end}")
    with open(path("place.obj"), "w") as file:
        file.write("g concrete\n")
        file.writelines("v %.6f %.6f %.6f\n" % turned(v) for v in mesh.vertices)
        file.writelines("f %d %d %d\n" % f for f in mesh.faces)
    with open(path("poses.tum"), "w") as file:
        for i, (x, y, z, yaw, pitch, roll) in enumerate(poses):
            numbers = (i, *turned((x, y, z)), *quaternion(yaw + turn, pitch, roll))
            file.write(" ".join(map(str, numbers)) + "\n")
    command = [echoloop, "scan", "--quiet", "--seed", str(number + 1), "--scene", path("place.obj")]
    command += ["--trajectory", path("poses.tum"), "-o", path("scans"), "--threads", "1"]
    for setting in PATTERNS[pattern]:
        command += ["--set", setting]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    for i, end in enumerate(("target", "source")):
        os.rename(os.path.join(path("scans"), f"{i:06}.ply"), path(f"{end}.ply"))
    with open(os.path.join(path("scans"), "poses.txt")) as file:
        first, second = ([float(x) for x in line.split()] for line in file)
    write_motion(path("target_from_source.txt"), relative(first, second))


def write_motion(path, rows):
    with open(path, "w") as file:
        file.writelines(" ".join(map(repr, row)) + "\n" for row in rows)


def write_pairs(folder, first, count, write):
    """Makes a folder with what `write` writes of each name, from FIRST on, and with their list."""
    os.makedirs(folder)
    names = [f"{number:03}" for number in range(int(first), int(first) + int(count))]
    for name in names:
        write(name)
    with open(os.path.join(folder, "pairs.json"), "w") as file:
        json.dump({"pairs": [{"name": name} for name in names]}, file)


def main():
    echoloop, folder, kind, pattern, first, count = sys.argv[1:]
    write = lambda name: scan(echoloop, folder, name, kind, pattern, int(name))
    write_pairs(folder, first, count, write)


if __name__ == "__main__":
    main()
