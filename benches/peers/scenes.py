"""Pairs of scans of generated places, cast by Open3D: the town pair of the speed table. Seeded, the same on every run.

A place is a terrain with buildings, cars, poles and trees. A scan is a spinning 64-ring sensor 2 m above the ground,
with 2 cm of range noise and 2 % of beams lost.
"""

import numpy as np
import open3d as o3d

GROUND_M = {"structured": 0.15, "semi-structured": 0.8, "unstructured": 2.5}
SEEDS = {"structured": 1, "semi-structured": 2, "unstructured": 3}
NOISE_M, FARTHEST_M, NEAREST_M, LOST = 0.02, 90.0, 0.8, 0.02


def box(x, y, z, size, yaw=0.0):
    """A box on z, centred at x, y."""
    mesh = o3d.geometry.TriangleMesh.create_box(*size)
    mesh.translate((-size[0] / 2, -size[1] / 2, 0))
    mesh.rotate(o3d.geometry.get_rotation_matrix_from_xyz((0, 0, yaw)), center=(0, 0, 0))
    return mesh.translate((x, y, z))


def pole(x, y, z, radius, height):
    """A cylinder on z."""
    mesh = o3d.geometry.TriangleMesh.create_cylinder(radius, height, 12)
    return mesh.translate((x, y, z + height / 2))


def blob(rng, centre, radius, flatness=1.0, resolution=8, noise=0.25):
    """A crown of leaves or a rock: a sphere with its vertices moved in or out."""
    mesh = o3d.geometry.TriangleMesh.create_sphere(radius, resolution)
    vertices = np.asarray(mesh.vertices)
    vertices *= 1 + noise * rng.standard_normal((len(vertices), 1))
    vertices[:, 2] *= flatness
    mesh.vertices = o3d.utility.Vector3dVector(vertices)
    return mesh.translate(centre)


def terrain(rng, amplitude, size=140, step=2.0):
    """A ground of twelve waves, and its height function."""
    n = int(2 * size / step) + 1
    grid = np.linspace(-size, size, n)
    x, y = np.meshgrid(grid, grid, indexing="ij")
    z = np.zeros_like(x)
    for _ in range(12):
        kx, ky = rng.normal(0, 0.06, 2)
        z += rng.uniform(0.3, 1) * np.sin(kx * x + ky * y + rng.uniform(0, 6.28))
    z *= amplitude / np.abs(z).max()
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = (index[i : n - 1 + i, j : n - 1 + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    vertices = np.stack([x, y, z], -1).reshape(-1, 3)
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces))

    def height(x, y):
        u, v = (x + size) / step, (y + size) / step
        i, j = min(max(int(u), 0), n - 2), min(max(int(v), 0), n - 2)
        u, v = u - i, v - j
        near = z[i, j] * (1 - u) * (1 - v) + z[i + 1, j] * u * (1 - v)
        return float(near + z[i, j + 1] * (1 - u) * v + z[i + 1, j + 1] * u * v)

    return mesh, height


def street(rng, height):
    """Two rows of houses with bays, parked cars, poles."""
    for side in (-1, 1):
        y = -110
        while y < 110:
            width, depth, storeys = rng.uniform(8, 18), rng.uniform(8, 16), rng.uniform(5, 18)
            front = rng.uniform(9, 13)
            x, middle = side * (front + depth / 2), y + width / 2
            z = height(x, middle) - 0.5
            yield box(x, middle, z, (depth, width * 0.96, storeys))
            for _ in range(rng.integers(1, 5)):
                bay = rng.uniform(1, 3)
                at = side * (front - rng.uniform(0.2, 0.8)), middle + rng.uniform(-width / 2.5, width / 2.5)
                yield box(*at, z + rng.uniform(0, storeys * 0.7), (1.4, bay, rng.uniform(0.8, 3)))
            y += width + rng.choice([0.3, 2.5, 6.0], p=[0.5, 0.3, 0.2])
    for _ in range(26):
        x, y = rng.choice([-5.5, 5.5]) + rng.normal(0, 0.25), rng.uniform(-90, 90)
        z = height(x, y)
        yield box(x, y, z + 0.3, (1.8, 4.3, 0.75), rng.normal(0, 0.03))
        yield box(x, y - 0.2, z + 1.0, (1.6, 2.2, 0.6))
    for _ in range(24):
        x, y = rng.choice([-7.5, 7.5]) + rng.normal(0, 0.2), rng.uniform(-100, 100)
        yield pole(x, y, height(x, y), 0.12, rng.uniform(4, 8))


def suburb(rng, height):
    """Scattered houses and walls."""
    for _ in range(16):
        x, y = rng.uniform(-80, 80, 2)
        x += 16 * np.sign(x + 1e-9) if abs(x) < 8 else 0
        z, yaw = height(x, y) - 1, rng.uniform(0, 3.14)
        yield box(x, y, z, (rng.uniform(7, 14), rng.uniform(7, 12), rng.uniform(4, 8)), yaw)
        yield box(x + 2, y + 3, z, (rng.uniform(3, 6), rng.uniform(3, 6), rng.uniform(3, 5)), yaw)
    for _ in range(10):
        x, y = rng.uniform(-60, 60, 2)
        yield box(x, y, height(x, y) - 0.2, (0.15, rng.uniform(8, 25), 1.4), rng.uniform(0, 3.14))


def rocks(rng, height):
    """Boulders in the open."""
    for _ in range(40):
        x, y = rng.uniform(-70, 70, 2)
        z, radius = height(x, y), rng.uniform(0.4, 2.2)
        yield blob(rng, (x, y, z), radius, 0.7, 6, 0.2)


def trees(rng, height, kind):
    """Trunks with crowns; in a street, along it."""
    for _ in range({"structured": 10, "semi-structured": 60, "unstructured": 130}[kind]):
        x, y = rng.uniform(-75, 75, 2)
        if kind == "structured":
            x = rng.choice([-8.2, 8.2]) + rng.normal(0, 0.4)
        if np.hypot(x, y) < 3:
            continue
        z, trunk, radius = height(x, y), rng.uniform(2, 5), rng.uniform(1.0, 2.8)
        yield pole(x, y, z - 0.3, rng.uniform(0.1, 0.3), trunk + 1)
        yield blob(rng, (x, y, z + trunk + radius * 0.7), radius, rng.uniform(0.8, 1.4))


def place(kind, rng):
    """Scene for ray casting, and the height function of its ground."""
    ground, height = terrain(rng, GROUND_M[kind])
    things = {"structured": street, "semi-structured": suburb, "unstructured": rocks}[kind]
    scene = o3d.t.geometry.RaycastingScene()
    for mesh in [ground, *things(rng, height), *trees(rng, height, kind)]:
        scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    return scene, height


def beams(columns=2048, rings=64):
    """Unit vectors of the beams: all around, from 25° below to 15° above."""
    azimuth = np.linspace(-np.pi, np.pi, columns, endpoint=False)
    a, e = np.meshgrid(azimuth, np.deg2rad(np.linspace(-25, 15, rings)))
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], -1).reshape(-1, 3)


def scan(scene, world_from_sensor, rng, directions):
    """Points in the sensor's frame, m."""
    rays = np.empty((len(directions), 6), np.float32)
    rays[:, :3] = world_from_sensor[:3, 3]
    rays[:, 3:] = directions @ world_from_sensor[:3, :3].T
    ranges = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy().astype(np.float64)
    hit = np.isfinite(ranges) & (ranges < FARTHEST_M) & (ranges > NEAREST_M) & (rng.random(len(ranges)) > LOST)
    noisy = ranges[hit] + rng.normal(0, NOISE_M, hit.sum())
    return (directions[hit] * noisy[:, None]).astype(np.float32)


def stand(x, y, height, yaw, rng):
    """Pose of a sensor 2 m above the ground, nearly upright."""
    pose = np.eye(4)
    tilt = rng.normal(0, 0.02), rng.normal(0, 0.02)
    pose[:3, :3] = o3d.geometry.get_rotation_matrix_from_xyz((*tilt, yaw))
    pose[:3, 3] = x, y, height(x, y) + 2
    return pose


def make_pair(kind, number=0, baseline_m=5.0, yaw_range=np.pi, directions=None):
    """Source, target and target_from_source of two scans of a place."""
    rng = np.random.default_rng(1000 * number + SEEDS[kind])
    directions = beams() if directions is None else directions
    scene, height = place(kind, rng)
    along = np.pi / 2 if kind == "structured" else rng.uniform(0, 6.28)
    x = rng.uniform(-2, 2)
    y = rng.uniform(-40, 40) if kind == "structured" else rng.uniform(-25, 25)
    way = along + rng.normal(0, 0.3)
    first = stand(x, y, height, along + rng.normal(0, 0.1), rng)
    there = x + baseline_m * np.cos(way), y + baseline_m * np.sin(way)
    second = stand(*there, height, along + yaw_range * rng.uniform(-1, 1), rng)
    target = scan(scene, first, rng, directions)
    return scan(scene, second, rng, directions), target, np.linalg.inv(first) @ second
