"""Writes host/registration/tests/data/fpfh_open3d.txt: points of our making, their normals, and Open3D 0.20's FPFH for them.

usage: fpfh_fixture.py > host/registration/tests/data/fpfh_open3d.txt
"""

import numpy as np
import open3d as o3d

rng = np.random.default_rng(7)
points = rng.uniform(-2.0, 2.0, (120, 3)).astype(np.float32)
normals = rng.normal(size=(120, 3))
normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))
cloud.normals = o3d.utility.Vector3dVector(normals.astype(np.float64))
param = o3d.geometry.KDTreeSearchParamHybrid(radius=1.5, max_nn=40)
rows = o3d.pipelines.registration.compute_fpfh_feature(cloud, param).data.T
print(f"# x y z nx ny nz and the 33 numbers of Open3D {o3d.__version__}: radius 1.5, 40 neighbours (fpfh_fixture.py)")
for p, n, row in zip(points, normals, rows):
    print(*(f"{v:.9g}" for v in (*p, *n)), *(f"{v:.6g}" for v in row))
