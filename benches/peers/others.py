"""Stages of the peers: Open3D (legacy and tensor), small_gicp, KISS-Matcher, called as their users do."""

from functools import cached_property

import kiss_matcher
import numpy as np
import open3d as o3d
import small_gicp

from common import clocked

o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
LEGACY, TENSOR = o3d.pipelines.registration, o3d.t.pipelines.registration
NORMAL_RADIUS, NORMAL_NEIGHBOURS = 3.0, 30  # radii in voxels
FEATURE_RADIUS, FEATURE_NEIGHBOURS = 5.0, 100
LOCAL_PAIR_DISTANCE_M, LOCAL_ITERATIONS = 1.0, 30
COVARIANCE_NEIGHBOURS, VOXEL_MAP_M = 20, 1.0

OF_THINNED = {"normals", "fpfh", "match", "icp_align", "gicp_align"}  # stages that take the voxels' points
STARTS_FROM = {
    ("normals", "Open3D"): "thin",
    ("normals", "Open3D tensor"): "thin_tensor",
    ("normals", "small_gicp"): "gicp_thin",
    ("fpfh", "Open3D"): "normal",
    ("fpfh", "Open3D tensor"): "normal_tensor",
    ("match", "Open3D"): "feature",
    ("icp_align", "Open3D"): "normal",
    ("icp_align", "Open3D tensor"): "normal_tensor",
    ("icp_align", "small_gicp"): "prepared",
    ("gicp_align", "small_gicp"): "prepared",
    ("icp_target", "small_gicp"): "prepared",
    ("icp_target", "Open3D"): "normal",
    ("gicp_target", "small_gicp"): "prepared",
}


def legacy(points):
    """Open3D's cloud."""
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))


def tensor(points):
    """Open3D's tensor cloud, float."""
    return o3d.t.geometry.PointCloud(o3d.core.Tensor(np.ascontiguousarray(points, np.float32)))


def hybrid(radius_m, neighbours):
    """Search for the nearest neighbours within a radius."""
    return o3d.geometry.KDTreeSearchParamHybrid(radius=radius_m, max_nn=neighbours)


def with_normals(cloud, voxel_m, radius=NORMAL_RADIUS, towards_sensor=True):
    """A copy with normals; Open3D does not orient them by default."""
    cloud = o3d.geometry.PointCloud(cloud)
    cloud.estimate_normals(hybrid(radius * voxel_m, NORMAL_NEIGHBOURS))
    if towards_sensor:
        cloud.orient_normals_towards_camera_location()
    return cloud


def with_normals_tensor(cloud, voxel_m):
    """As above, for the tensor cloud, without orientation."""
    cloud = cloud.clone()
    cloud.estimate_normals(max_nn=NORMAL_NEIGHBOURS, radius=NORMAL_RADIUS * voxel_m)
    return cloud


def features(cloud, voxel_m):
    """FPFH, 33 × n."""
    return LEGACY.compute_fpfh_feature(cloud, hybrid(FEATURE_RADIUS * voxel_m, FEATURE_NEIGHBOURS))


def features_tensor(cloud, voxel_m):
    """FPFH, n × 33."""
    return TENSOR.compute_fpfh_feature(cloud, max_nn=FEATURE_NEIGHBOURS, radius=FEATURE_RADIUS * voxel_m)


def fgr_default(source, target, voxel_m):
    """Open3D's global registration example, from the clouds to the pose: normals within 2 voxels, options of Python."""

    def describe(points):
        cloud = with_normals(legacy(points).voxel_down_sample(voxel_m), voxel_m, 2.0, towards_sensor=False)
        return cloud, features(cloud, voxel_m)

    (s, fs), (t, ft) = describe(source), describe(target)
    option = LEGACY.FastGlobalRegistrationOption(maximum_correspondence_distance=0.5 * voxel_m)
    return LEGACY.registration_fgr_based_on_feature_matching(s, t, fs, ft, option).transformation


def fgr_tuned(source, target, voxel_m):
    """The best of Open3D's own options: μ falls to (voxel / radius)² in 256 steps; normals face the sensor.

    Its options compare μ, a square on points scaled to radius 1, with `maximum_correspondence_distance`; by default μ
    does not fall at all.
    """

    def describe(points):
        cloud = with_normals(legacy(points).voxel_down_sample(voxel_m), voxel_m)
        return cloud, features(cloud, voxel_m)

    (s, fs), (t, ft) = describe(source), describe(target)
    radius = max(np.linalg.norm(p - p.mean(0), axis=1).max() for p in (np.asarray(s.points), np.asarray(t.points)))
    option = LEGACY.FastGlobalRegistrationOption(
        decrease_mu=True, iteration_number=256, maximum_correspondence_distance=(voxel_m / radius) ** 2
    )
    return LEGACY.registration_fgr_based_on_feature_matching(s, t, fs, ft, option).transformation


def kiss(source, target, voxel_m):
    """KISS-Matcher with its defaults for the voxel, and the number of matches that agree."""
    matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(voxel_m))
    found = matcher.estimate(source.astype(np.float32), target.astype(np.float32))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = found.rotation, found.translation
    return matcher.get_num_final_inliers(), pose


def kiss_gicp(source, target, voxel_m):
    """KISS-Matcher, then small_gicp's GICP with pairs within two voxels."""
    _, pose = kiss(source, target, voxel_m)
    found = small_gicp.align(
        target,
        source,
        pose,
        registration_type="GICP",
        downsampling_resolution=voxel_m,
        max_correspondence_distance=2 * voxel_m,
        num_threads=1,
        max_iterations=LOCAL_ITERATIONS,
    )
    return found.num_inliers, found.T_target_source


class Others:
    """Stages of a pair; inputs of a stage are computed at its first run, before the clock starts."""

    def __init__(self, source, target, voxel_m, initial, threads, tensor_icp=True):
        self.source, self.target, self.voxel_m, self.initial, self.threads = source, target, voxel_m, initial, threads
        self.tensor_icp = tensor_icp
        self.s, self.t = legacy(source), legacy(target)
        self.st, self.tt = tensor(source), tensor(target)
        self.gicp_cloud = small_gicp.PointCloud(source)
        self.rows = self._rows()

    @cached_property
    def thin(self):
        """Open3D's voxels of the source."""
        return self.s.voxel_down_sample(self.voxel_m)

    @cached_property
    def thin_tensor(self):
        """The same, tensor."""
        return self.st.voxel_down_sample(self.voxel_m)

    @cached_property
    def gicp_thin(self):
        """The same, small_gicp."""
        return small_gicp.voxelgrid_sampling(self.gicp_cloud, self.voxel_m, num_threads=self.threads)

    @cached_property
    def normal(self):
        """Source and target with Open3D's normals."""
        return [with_normals(cloud, self.voxel_m) for cloud in (self.thin, self.t.voxel_down_sample(self.voxel_m))]

    @cached_property
    def normal_tensor(self):
        """The same, tensor."""
        clouds = self.thin_tensor, self.tt.voxel_down_sample(self.voxel_m)
        return [with_normals_tensor(cloud, self.voxel_m) for cloud in clouds]

    @cached_property
    def feature(self):
        """Open3D's features of source and target."""
        return [features(cloud, self.voxel_m) for cloud in self.normal]

    @cached_property
    def prepared(self):
        """Inputs of small_gicp: source, target, and the target's tree."""
        options = {"downsampling_resolution": self.voxel_m, "num_threads": self.threads}
        options["num_neighbors"] = COVARIANCE_NEIGHBOURS
        source, _ = small_gicp.preprocess_points(self.source, **options)
        return source, *small_gicp.preprocess_points(self.target, **options)

    def run(self, stage, peer):
        """One run of a peer's stage; its inputs are computed before the clock starts."""
        getattr(self, STARTS_FROM.get((stage, peer), "source"))
        n_in = len(self.thin.points) if stage in OF_THINNED else len(self.source)
        return clocked(self.rows[stage][peer], n_in)

    def _rows(self):
        table = {
            "voxel": {"Open3D": self.voxel, "Open3D tensor": self.voxel_tensor, "small_gicp": self.voxel_gicp},
            "normals": {"Open3D": self.normals, "Open3D tensor": self.normals_tensor, "small_gicp": self.normals_gicp},
            "fpfh": {"Open3D": self.fpfh, "Open3D tensor": self.fpfh_tensor},
            "describe": {"Open3D": self.describe, "Open3D tensor": self.describe_tensor},
            "match": {"Open3D": self.match},
            "icp_align": {"Open3D": self.icp, "Open3D tensor": self.icp_tensor, "small_gicp": self.plane_icp},
            "icp": {"Open3D": self.icp_whole, "small_gicp": lambda: self.whole("PLANE_ICP")},
            "gicp_align": {"small_gicp": self.gicp},
            "icp_target": {"small_gicp": lambda: self.to_target("PLANE_ICP"), "Open3D": self.icp_to_target},
            "gicp_target": {"small_gicp": lambda: self.to_target("GICP")},
            "gicp": {
                "small_gicp": lambda: self.whole("GICP"),
                "small_gicp VGICP": lambda: self.whole("VGICP"),
                "Open3D": self.gicp_open3d,
            },
            "fgr": {
                "Open3D": lambda: (0, fgr_default(self.source, self.target, self.voxel_m)),
                "Open3D tuned": lambda: (0, fgr_tuned(self.source, self.target, self.voxel_m)),
                "KISS-Matcher": lambda: kiss(self.source, self.target, self.voxel_m),
            },
        }
        table["auto"] = table["fgr"]
        if not self.tensor_icp:
            del table["icp_align"]["Open3D tensor"]
        return table

    def voxel(self):
        """Open3D: the mean of each voxel."""
        return len(self.s.voxel_down_sample(self.voxel_m).points), None

    def voxel_tensor(self):
        """The same, tensor."""
        return len(self.st.voxel_down_sample(self.voxel_m).point.positions), None

    def voxel_gicp(self):
        """The same, small_gicp."""
        return small_gicp.voxelgrid_sampling(self.gicp_cloud, self.voxel_m, num_threads=self.threads).size(), None

    def normals(self):
        """Open3D, which builds the tree inside and does not orient normals."""
        return len(with_normals(self.thin, self.voxel_m, towards_sensor=False).normals), None

    def normals_tensor(self):
        """The same, tensor."""
        return len(with_normals_tensor(self.thin_tensor, self.voxel_m).point.normals), None

    def normals_gicp(self):
        """small_gicp: tree, then normals and covariances of the 20 nearest."""
        tree = small_gicp.KdTree(self.gicp_thin, num_threads=self.threads)
        options = {"num_neighbors": COVARIANCE_NEIGHBOURS, "num_threads": self.threads}
        small_gicp.estimate_normals_covariances(self.gicp_thin, tree, **options)
        return self.gicp_thin.size(), None

    def fpfh(self):
        """Open3D, from points with normals."""
        return features(self.normal[0], self.voxel_m).num(), None

    def fpfh_tensor(self):
        """The same, tensor."""
        return len(features_tensor(self.normal_tensor[0], self.voxel_m)), None

    def describe(self):
        """Open3D: voxels, normals, FPFH of one cloud."""
        cloud = with_normals(self.s.voxel_down_sample(self.voxel_m), self.voxel_m)
        return features(cloud, self.voxel_m).num(), None

    def describe_tensor(self):
        """The same, tensor."""
        cloud = with_normals_tensor(self.st.voxel_down_sample(self.voxel_m), self.voxel_m)
        return len(features_tensor(cloud, self.voxel_m)), None

    def match(self):
        """Open3D: exact mutual nearest neighbours in 33 dimensions."""
        return len(LEGACY.correspondences_from_features(*self.feature, True, 0.0)), None

    def icp(self):
        """Open3D, from points with normals; it builds its tree inside."""
        return self._open3d(*self.normal)

    def _open3d(self, source, target):
        estimation = LEGACY.TransformationEstimationPointToPlane()
        criteria = LEGACY.ICPConvergenceCriteria(1e-6, 1e-6, LOCAL_ITERATIONS)
        found = LEGACY.registration_icp(source, target, LOCAL_PAIR_DISTANCE_M, self.initial, estimation, criteria)
        return len(found.correspondence_set), found.transformation

    def icp_tensor(self):
        """The same, tensor."""
        criteria = TENSOR.ICPConvergenceCriteria(1e-6, 1e-6, LOCAL_ITERATIONS)
        found = TENSOR.icp(
            *self.normal_tensor,
            LOCAL_PAIR_DISTANCE_M,
            o3d.core.Tensor(self.initial),
            TENSOR.TransformationEstimationPointToPlane(),
            criteria,
        )
        return 0, found.transformation.numpy()

    def icp_whole(self):
        """Open3D: voxels of both, normals of the target, ICP."""
        source, target = (cloud.voxel_down_sample(self.voxel_m) for cloud in (self.s, self.t))
        return self._open3d(source, with_normals(target, self.voxel_m, towards_sensor=False))

    def gicp_open3d(self):
        """Open3D's GICP: voxels and normals of both."""
        source, target = (
            with_normals(cloud.voxel_down_sample(self.voxel_m), self.voxel_m, towards_sensor=False)
            for cloud in (self.s, self.t)
        )
        criteria = LEGACY.ICPConvergenceCriteria(1e-6, 1e-6, LOCAL_ITERATIONS)
        estimation = LEGACY.TransformationEstimationForGeneralizedICP()
        options = (LOCAL_PAIR_DISTANCE_M, self.initial, estimation, criteria)
        found = LEGACY.registration_generalized_icp(source, target, *options)
        return len(found.correspondence_set), found.transformation

    def plane_icp(self):
        """small_gicp, from prepared clouds, tree included."""
        return self._small("PLANE_ICP")

    def gicp(self):
        """The same, GICP."""
        return self._small("GICP")

    def to_target(self, kind):
        """small_gicp, from the source as read to a prepared target."""
        options = {"downsampling_resolution": self.voxel_m, "num_threads": self.threads}
        source, _ = small_gicp.preprocess_points(self.source, num_neighbors=COVARIANCE_NEIGHBOURS, **options)
        return self._small(kind, source)

    def icp_to_target(self):
        """Open3D, from the source as read to a target with normals."""
        return self._open3d(legacy(self.source).voxel_down_sample(self.voxel_m), self.normal[1])

    def _small(self, kind, own=None):
        source, target, tree = self.prepared
        source = own or source
        found = small_gicp.align(
            target,
            source,
            tree,
            self.initial,
            registration_type=kind,
            max_correspondence_distance=LOCAL_PAIR_DISTANCE_M,
            num_threads=self.threads,
            max_iterations=LOCAL_ITERATIONS,
        )
        return found.num_inliers, found.T_target_source

    def whole(self, kind):
        """small_gicp from the clouds as read; covariances of the 10 nearest, its default."""
        found = small_gicp.align(
            self.target,
            self.source,
            self.initial,
            registration_type=kind,
            voxel_resolution=VOXEL_MAP_M,
            downsampling_resolution=self.voxel_m,
            max_correspondence_distance=LOCAL_PAIR_DISTANCE_M,
            num_threads=self.threads,
            max_iterations=LOCAL_ITERATIONS,
        )
        return found.num_inliers, found.T_target_source
