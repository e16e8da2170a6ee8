"""Clouds, poses and clocks shared by the scripts."""

import statistics
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np


class Took(NamedTuple):
    """One run of one stage."""

    cpu_ms: float
    wall_ms: float
    n_in: int
    n_out: int
    pose: object  # target_from_source, 4 × 4, or None
    stop: object = None  # why ours ended


def clocked(work, n_in):
    """Runs `work`, which returns a count and a pose or None. CPU time is that of all threads of this process."""
    wall, cpu = time.perf_counter(), time.process_time()
    n_out, pose = work()
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    return Took(1e3 * cpu, 1e3 * wall, n_in, n_out, pose)


def median(values):
    """Median; NaN without values."""
    values = list(values)
    return statistics.median(values) if values else float("nan")


def errors(pose, truth):
    """Distance of the translations, m, and angle of the rotations, degrees."""
    turn = np.linalg.inv(truth)[:3, :3] @ pose[:3, :3]
    sine = np.linalg.norm([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    degrees = np.degrees(np.arctan2(sine, np.trace(turn) - 1))
    return float(np.linalg.norm(pose[:3, 3] - truth[:3, 3])), float(degrees)


def write_ply(path, points):
    """Little-endian binary PLY of x y z, float."""
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    Path(path).write_bytes(header.encode() + np.ascontiguousarray(points, "<f4").tobytes())


def read_ply(path):
    """Points of a PLY file as Open3D reads them, without those at range 0 and those that are not finite."""
    import open3d

    points = np.asarray(open3d.io.read_point_cloud(str(path)).points)
    return points[np.isfinite(points).all(1) & points.any(1)]


class PairFiles(NamedTuple):
    """Two clouds on disk, their true motion, and the initial pose of local methods."""

    name: str
    target: Path
    source: Path
    truth: np.ndarray
    initial: np.ndarray

    def clouds(self):
        """Source and target."""
        return read_ply(self.source), read_ply(self.target)


def offset():
    """Offset of the initial pose from the truth when the identity is too far: 0.6 m, 2.9°."""
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(0.05), -np.sin(0.05)], [np.sin(0.05), np.cos(0.05)]]
    pose[:3, 3] = 0.5, -0.3, 0.1
    return pose
