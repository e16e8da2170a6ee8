"""Clouds of Open3D and small_gicp, registered without a guess, and finished by either.

python beside_open3d_and_small_gicp.py target.ply source.ply
"""

import argparse
from typing import Any

import echoloop
import numpy as np
import open3d as o3d
import small_gicp


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target", help="cloud that stays")
    parser.add_argument("source", help="cloud that moves")
    parser.add_argument("--voxel", type=float, default=0.3, help="voxel of the others, m")
    parser.add_argument("--output", help="both clouds in one, written by Open3D")
    args = parser.parse_args()

    # Clouds of Open3D, and of small_gicp, are taken as they are: they have points.
    target, source = (o3d.io.read_point_cloud(path) for path in (args.target, args.source))
    found = echoloop.register(target, source)
    print(found)
    small = [small_gicp.PointCloud(np.asarray(cloud.points)) for cloud in (target, source)]
    same = echoloop.register(*small)
    assert (same.target_from_source == found.target_from_source).all()
    if not found:
        raise SystemExit(f"not registered: {found.stop}")

    # What it found is a guess good enough for local methods.
    guess = found.target_from_source
    gicp = small_gicp.align(
        np.asarray(target.points), np.asarray(source.points), guess,
        registration_type="GICP", downsampling_resolution=args.voxel,
    )
    others: dict[str, Any] = {"small_gicp, GICP": gicp.T_target_source}
    thinned = [cloud.voxel_down_sample(args.voxel) for cloud in (target, source)]
    thinned[0].estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(3 * args.voxel, 30))
    plane = o3d.pipelines.registration.TransformationEstimationPointToPlane()
    icp = o3d.pipelines.registration.registration_icp(
        thinned[1], thinned[0], 2 * args.voxel, guess, plane
    )
    others["Open3D, point-to-plane ICP"] = icp.transformation
    for who, motion in others.items():
        apart = np.linalg.inv(guess) @ motion
        shift_cm = 100 * np.linalg.norm(apart[:3, 3])
        turn_deg = np.degrees(np.arccos(np.clip((np.trace(apart[:3, :3]) - 1) / 2, -1, 1)))
        print(f"{who}: {shift_cm:.1f} cm and {turn_deg:.2f}° from it")

    if args.output:
        source.transform(guess)
        o3d.io.write_point_cloud(args.output, target + source)


if __name__ == "__main__":
    main()
