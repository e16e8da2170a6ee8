"""Our stages by the module `echoloop`: the calls of its users, on the arrays that the peers get."""

import time
from functools import cached_property

import echoloop
import numpy as np

from common import clocked, read_ply

NORMAL_RADIUS, NORMAL_NEIGHBOURS = 3.0, 30  # radii in voxels, as of the peers
FEATURE_RADIUS, FEATURE_NEIGHBOURS = 5.0, 100
LOCAL = {"max_pair_distance_m": 1.0, "first_pair_distance_m": None, "max_iterations": 30}
NO_CHECK = {"check": False}  # of the motion on both clouds, which no peer makes
OF_THINNED = {"normals", "fpfh", "match"}


class Pair:
    """A pair; inputs of a stage are computed at its first run, before the clock starts."""

    def __init__(self, target, source, voxel_m, initial):
        self.target, self.source, self.voxel_m, self.initial = target, source, voxel_m, initial
        icp = {"normal_radius_m": NORMAL_RADIUS * voxel_m, "normal_neighbours": NORMAL_NEIGHBOURS}
        self.icp = {"voxel_m": voxel_m, **LOCAL, **icp}
        self.gicp = {"voxel_m": voxel_m, **LOCAL, "normal_radius_m": FEATURE_RADIUS * voxel_m}

    def thinned(self, points):
        """Voxels."""
        return echoloop.voxel_downsample(points, self.voxel_m)

    def normals(self, points):
        """Normals towards the sensor."""
        return echoloop.estimate_normals(points, NORMAL_RADIUS * self.voxel_m, NORMAL_NEIGHBOURS)

    def features(self, points, normals):
        """FPFH, n × 33."""
        return echoloop.fpfh(points, normals, FEATURE_RADIUS * self.voxel_m, FEATURE_NEIGHBOURS)

    def described(self, points):
        """Voxels to FPFH."""
        thin = self.thinned(points)
        return self.features(thin, self.normals(thin))

    @cached_property
    def thin(self):
        """Voxels of the source."""
        return self.thinned(self.source)

    @cached_property
    def thin_normals(self):
        """Their normals."""
        return self.normals(self.thin)

    @cached_property
    def both_features(self):
        """Features of target and source."""
        return self.described(self.target), self.features(self.thin, self.thin_normals)

    @cached_property
    def prepared(self):
        """Targets of ICP and GICP, with the check and without."""
        make = lambda method, **check: echoloop.Target(self.target, method, **getattr(self, method), **check)  # noqa: E731
        return {(method, checked): make(method, check=checked) for method in ("icp", "gicp") for checked in (True, False)}

    def registered(self, method, initial=None, **settings):
        """Matches of the last step and pose, from the arrays."""
        found = echoloop.register(self.target, self.source, method, initial=initial, **settings)
        return found.pairs, found.target_from_source

    def laid(self, method, check):
        """The same on a prepared target."""
        found = self.prepared[method, check].register(self.source, initial=self.initial)
        return found.pairs, found.target_from_source


STAGES = {
    "voxel": (lambda p: (len(p.thinned(p.source)), None), ()),
    "normals": (lambda p: (len(p.normals(p.thin)), None), ("thin",)),
    "fpfh": (lambda p: (len(p.features(p.thin, p.thin_normals)), None), ("thin_normals",)),
    "describe": (lambda p: (len(p.described(p.source)), None), ()),
    "match": (lambda p: (len(echoloop.match_features(*p.both_features)), None), ("both_features",)),
    "icp": (lambda p: p.registered("icp", p.initial, **p.icp, **NO_CHECK), ()),
    "icp_checked": (lambda p: p.registered("icp", p.initial, **p.icp), ()),
    "gicp": (lambda p: p.registered("gicp", p.initial, **p.gicp, **NO_CHECK), ()),
    "gicp_checked": (lambda p: p.registered("gicp", p.initial, **p.gicp), ()),
    "icp_target": (lambda p: p.laid("icp", False), ("prepared",)),
    "icp_target_checked": (lambda p: p.laid("icp", True), ("prepared",)),
    "gicp_target": (lambda p: p.laid("gicp", False), ("prepared",)),
    "gicp_target_checked": (lambda p: p.laid("gicp", True), ("prepared",)),
    "fgr": (lambda p: p.registered("fgr", voxel_m=p.voxel_m, **NO_CHECK), ()),
    "fgr_checked": (lambda p: p.registered("fgr", voxel_m=p.voxel_m), ()),
    "mac": (lambda p: p.registered("mac", voxel_m=p.voxel_m, **NO_CHECK), ()),
    "mac_checked": (lambda p: p.registered("mac", voxel_m=p.voxel_m), ()),
    "auto": (lambda p: p.registered("auto"), ()),
}


class Module:
    """Stages of a pair, run in this process."""

    def load(self, target, source, voxel_m, initial=None):
        """Sets the pair and the voxel."""
        initial = np.eye(4) if initial is None else np.asarray(initial)
        self.pair = Pair(read_ply(target), read_ply(source), voxel_m, initial)

    def run(self, stage):
        """One run; its inputs are computed before the clock starts."""
        work, inputs = STAGES[stage]
        for name in inputs:
            getattr(self.pair, name)
        n_in = len(self.pair.thin if stage in OF_THINNED else self.pair.source)
        return clocked(lambda: work(self.pair), n_in)

    def close(self):
        """Ends nothing."""


def least_us(work, runs=300):
    """Least time of some runs, µs."""
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return 1e6 * min(times)


def overhead(points=20_000):
    """Least times, µs, of what a call does besides registration: clouds from arrays, and an empty call."""
    import open3d
    import small_gicp

    single = np.random.default_rng(1).uniform(-50, 50, (points, 3)).astype(np.float32)
    double, one = single.astype(np.float64), np.ones((1, 3), np.float32)
    clouds = {
        "Echoloop": echoloop.Cloud,
        "small_gicp": small_gicp.PointCloud,
        "Open3D": lambda points: open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points)),
    }
    rows = [
        (who, kind, least_us(lambda make=make, given=given: make(given)))
        for who, make in clouds.items()
        for kind, given in (("a cloud of float32", single), ("a cloud of float64", double))
    ]
    call = least_us(lambda: echoloop.register(one, one, "icp", voxel_m=1.0))
    return [*rows, ("Echoloop", "`register` of a point", call)]
