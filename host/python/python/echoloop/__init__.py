"""LiDAR registration, echoes of waveforms, and a sensor that is tuned with both.

Clouds are ``(N, 3)`` arrays, metres, in the frame of their sensor. A motion is called by what it
maps: ``target_from_source``.

    target, source = echoloop.read_cloud("target.ply"), echoloop.read_cloud("source.ply")
    found = echoloop.register(target, source)
    if found:
        print(found.target_from_source)
"""

from ._native import (
    Cloud,
    Detector,
    Infeasible,
    Objective,
    Registration,
    Scene,
    Sensor,
    Target,
    Tuner,
    Worker,
    estimate_normals,
    find_echoes,
    fpfh,
    match_features,
    read_cloud,
    register,
    scan,
    voxel_downsample,
    write_cloud,
)
from ._native import __version__ as __version__

__all__ = [
    "Cloud",
    "Detector",
    "Infeasible",
    "Objective",
    "Registration",
    "Scene",
    "Sensor",
    "Target",
    "Tuner",
    "Worker",
    "estimate_normals",
    "find_echoes",
    "fpfh",
    "match_features",
    "read_cloud",
    "register",
    "scan",
    "voxel_downsample",
    "write_cloud",
]
