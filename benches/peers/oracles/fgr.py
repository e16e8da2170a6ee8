"""Writes host/registration/tests/data/fgr_open3d.txt: own synthetic matches and the motions Open3D 0.20 finds for them.

usage: python fgr.py > host/registration/tests/data/fgr_open3d.txt          needs open3d==0.20, numpy

Without the tuple test Open3D's fast global registration draws nothing, so its result is exact to rounding.
"""

import numpy as np
import open3d as o3d

reg = o3d.pipelines.registration


def matches(count=60, wrong=18, seed=4):
    rng = np.random.default_rng(seed)
    source = rng.uniform([-20, -20, -2], [20, 20, 6], (count, 3))
    turn = o3d.geometry.get_rotation_matrix_from_xyz((0.05, -0.03, 0.6))
    target = source @ turn.T + [3.0, -2.0, 0.4] + rng.normal(0, 0.05, (count, 3))
    target[:wrong] = rng.uniform([-20, -20, -2], [20, 20, 6], (wrong, 3))
    return source.round(6), target.round(6)


def cloud(points):
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))


def motion(source, target, **options):
    option = reg.FastGlobalRegistrationOption(tuple_test=False, iteration_number=64, **options)
    pairs = o3d.utility.Vector2iVector(np.repeat(np.arange(len(source)), 2).reshape(-1, 2))
    result = reg.registration_fgr_based_on_correspondence(cloud(source), cloud(target), pairs, option)
    return result.transformation


source, target = matches()
print("# 60 matches: source x y z, target x y z, m")
for row in np.hstack([source, target]):
    print(*(f"{v:.6f}" for v in row))
variants = [{}, {"decrease_mu": True}, {"decrease_mu": True, "maximum_correspondence_distance": 1e-4}]
for options in variants:
    print(f"# target_from_source by Open3D {o3d.__version__}, {options}")
    print(*(f"{v:.15g}" for v in motion(source, target, **options).ravel()))
