"""Our FPFH and normals against Open3D 0.20's, on the town's clouds at a voxel of 0.3 m.

usage: fpfh.py FEATURES_EXAMPLE   (target/release/features; run it with the venv of `cargo xtask peers`)

Prints how many rows of features differ by more than a count's share, and how many normals have another direction or sign
than Open3D's own. Rows differ where two angles tie at a bin's edge: normals exactly opposed fall at +pi or -pi by a rounding.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import open3d as o3d

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import scenes

VOXEL = 0.3


def main(example):
    source, target, _ = scenes.make_pair("structured")
    for name, points in (("source", source), ("target", target)):
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.float64(np.float32(points))))
        cloud = cloud.voxel_down_sample(VOXEL)
        # What our side reads is f32: Open3D gets the same.
        cloud.points = o3d.utility.Vector3dVector(np.float64(np.float32(cloud.points)))
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(3 * VOXEL, 30))
        own = np.asarray(cloud.normals).copy()
        cloud.orient_normals_towards_camera_location()
        cloud.normals = o3d.utility.Vector3dVector(np.float64(np.float32(cloud.normals)))
        theirs = o3d.pipelines.registration.compute_fpfh_feature(
            cloud, o3d.geometry.KDTreeSearchParamHybrid(5 * VOXEL, 100)
        ).data.T
        with tempfile.TemporaryDirectory() as folder:
            path = [str(Path(folder) / f) for f in ("points", "normals", "features", "own")]
            np.asarray(cloud.points, np.float32).tofile(path[0])
            np.asarray(cloud.normals, np.float32).tofile(path[1])
            call = [example, path[0], path[1], str(5 * VOXEL), "100", path[2], path[3]]
            print(subprocess.run(call, check=True, capture_output=True, text=True).stdout.strip())
            ours = np.fromfile(path[2], np.float32).reshape(-1, 33)
            normals = np.fromfile(path[3], np.float32).reshape(-1, 3)
        far = abs(ours - theirs).max(1)
        along = (normals * own).sum(1)
        print(
            f"{name}: {len(far)} points; features differ by more than 0.5 in {(far > 0.5).sum()} rows, "
            f"by more than 5 in {(far > 5).sum()}; normals off by more than 1e-3 in {(abs(along) < 1 - 1e-3).sum()}, "
            f"opposed in {(along < 0).sum()}"
        )


if __name__ == "__main__":
    main(sys.argv[1])
