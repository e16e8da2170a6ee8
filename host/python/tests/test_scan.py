"""A scan of the simulated sensor is that of the program."""

from pathlib import Path
from typing import Any

import echoloop
import numpy as np
import pytest
from conftest import Run
from numpy.typing import NDArray

SCENE = {"scene.source": "structured", "scene.towns": [5, 8]}
SENSOR = {
    "scanner.pattern": "grid",
    "scanner.azimuth_deg": 360,
    "scanner.columns": 400,
    "scanner.rows": 24,
    "lidar.power": 40,
}


@pytest.fixture(scope="module")
def scene() -> echoloop.Scene:
    return echoloop.Scene(SCENE)


@pytest.fixture(scope="module")
def sensor() -> echoloop.Sensor:
    return echoloop.Sensor(SENSOR)


def test_a_scan_has_the_points_of_the_program(
    scene: echoloop.Scene, sensor: echoloop.Sensor, run: Run, tmp_path: Path
) -> None:
    sets = [f"--set={key}={value}" for key, value in {**SCENE, **SENSOR}.items()]
    run("scan", "--quiet", *sets, "--output", tmp_path / "own.ply")
    expected = echoloop.read_cloud(tmp_path / "own.ply")
    cloud, world_from_sensor = echoloop.scan(scene, sensor)
    np.testing.assert_array_equal(cloud.points, expected.points)
    assert cloud.columns.keys() == expected.columns.keys() and "reflectivity" in cloud.columns
    again, pose = echoloop.scan(scene, sensor, world_from_sensor)
    np.testing.assert_array_equal(again.points, cloud.points)
    np.testing.assert_allclose(pose, world_from_sensor, rtol=0, atol=1e-15)


def test_a_seed_is_of_the_noise_and_a_pose_of_the_view(
    scene: echoloop.Scene, sensor: echoloop.Sensor
) -> None:
    cloud, pose = echoloop.scan(scene, sensor)
    noisy, _ = echoloop.scan(scene, sensor, pose, seed=77)
    assert not np.array_equal(noisy.points, cloud.points)
    np.testing.assert_array_equal(echoloop.scan(scene, sensor, seed=77)[1], pose)
    ahead = pose.copy()
    ahead[:3, 3] += pose[:3, 0]  # a metre along x
    found = echoloop.register(cloud, echoloop.scan(scene, sensor, ahead)[0], "icp")
    np.testing.assert_allclose(found.target_from_source[:3, 3], [1, 0, 0], atol=0.1)


def test_points_lie_on_the_triangles(scene: echoloop.Scene, sensor: echoloop.Sensor) -> None:
    cloud, pose = echoloop.scan(scene, sensor)
    assert scene.vertices.dtype == np.float32 and scene.triangles.dtype == np.uint32
    corners = scene.vertices[scene.triangles].astype(float)
    assert corners.shape[1:] == (3, 3)

    def off_m(at: NDArray[np.float64]) -> float:
        """Distance along the beam to the nearest triangle that it meets."""
        eye = pose[:3, 3]
        way = (at - eye) / np.linalg.norm(at - eye)
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        across = np.cross(way, second)
        size = np.einsum("td,td->t", first, across)
        size[np.abs(size) < 1e-12] = np.inf
        from_corner = eye - corners[:, 0]
        u = np.einsum("td,td->t", from_corner, across) / size
        turned = np.cross(from_corner, first)
        v = turned @ way / size
        range_m = np.einsum("td,td->t", second, turned) / size
        meets = (u >= 0) & (v >= 0) & (u + v <= 1) & (range_m > 0)
        ranges = range_m[meets]
        return float(np.abs(ranges - np.linalg.norm(at - eye)).min()) if len(ranges) else np.inf

    points = cloud.points[:: len(cloud.points) // 40]
    off = [off_m(pose[:3, :3] @ point + pose[:3, 3]) for point in points]
    assert np.median(off) < 0.02, off
    turned = [off_m(pose[:3, :3].T @ point + pose[:3, 3]) for point in points]
    assert np.median(turned) > 0.2, "not by another turn"
    assert repr(scene) == f"<Scene {scene.name}, {len(corners)} triangles>"


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: echoloop.Scene({"scene.source": "nowhere.ply"}), "nowhere.ply"),
        (lambda: echoloop.Scene(SCENE, town=6), "town: expected one of 5, 8, found 6"),
        (lambda: echoloop.Sensor({"lidar.power": -1}), "lidar.power"),
        (lambda: echoloop.Sensor({"lidar.pover": 1}), "pover"),
    ],
)
def test_bad_settings_are_named(made: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        made()


def test_a_scan_of_the_sky_has_no_points(scene: echoloop.Scene) -> None:
    # A threshold that the noise does not reach.
    sensor = echoloop.Sensor({**SENSOR, "scanner.rows": 2, "lidar.snr_threshold": 8})
    above = np.eye(4)
    above[2, 3] = 1e4
    with pytest.raises(ValueError, match="no detection"):
        echoloop.scan(scene, sensor, above)
    with pytest.raises(ValueError, match="world_from_sensor: expected shape"):
        echoloop.scan(scene, sensor, np.eye(3))
