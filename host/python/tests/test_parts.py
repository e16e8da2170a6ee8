"""Clouds, voxels, normals, features and matches."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import echoloop
import numpy as np
import pytest

Clouds = tuple[echoloop.Cloud, echoloop.Cloud]


@pytest.mark.parametrize("extension", ["ply", "pcd"])
def test_a_written_cloud_reads_back(clouds: Clouds, tmp_path: Path, extension: str) -> None:
    path = tmp_path / f"a.{extension}"
    echoloop.write_cloud(path, clouds[0].points)
    assert (echoloop.read_cloud(str(path)).points == clouds[0].points).all()


def test_columns_of_a_file_are_kept(clouds: Clouds, tmp_path: Path) -> None:
    columns = clouds[0].columns
    assert "ring" in columns and columns["ring"].dtype.kind == "u"
    assert all(len(column) == len(clouds[0]) for column in columns.values())
    echoloop.write_cloud(tmp_path / "a.ply", clouds[0])
    back = echoloop.read_cloud(tmp_path / "a.ply")
    assert (back.columns["ring"] == columns["ring"]).all()
    assert back.range_sd_m is not None and clouds[0].range_sd_m is not None
    assert (back.range_sd_m == clouds[0].range_sd_m).all()


def test_a_file_that_is_no_cloud_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text("no cloud")
    with pytest.raises(ValueError, match=r"a\.ply: "):
        echoloop.read_cloud(tmp_path / "a.ply")
    with pytest.raises(ValueError, match=r"none\.ply"):
        echoloop.read_cloud(tmp_path / "none.ply")
    with pytest.raises(ValueError, match="expected a name that ends in"):
        echoloop.write_cloud(tmp_path / "a.doc", np.ones((3, 3)))
    with pytest.raises(ValueError, match="range_sd_m: expected 3 values, one a point, found 1"):
        echoloop.Cloud(np.ones((3, 3)), range_sd_m=[0.1])


def test_an_object_with_points_has_a_deviation_for_each() -> None:
    given: Any = SimpleNamespace(points=np.ones((3, 3)))
    assert echoloop.Cloud(given, range_sd_m=[0.1] * 3).range_sd_m is not None


def test_voxels_of_survey_coordinates_lie_where_the_points_are(clouds: Clouds) -> None:
    near = clouds[0].points.astype(np.float64)
    offset = np.array([500_000.0, 5_400_000.0, 300.0])
    found = echoloop.voxel_downsample(near + offset, 0.8)
    assert found.dtype == np.float64
    nearest = [np.linalg.norm(near + offset - at, axis=1).min() for at in found[::50]]
    assert max(nearest) < 0.8
    with pytest.raises(ValueError, match="points: expected them within 16384 m of the origin"):
        echoloop.estimate_normals(near + offset, 1.0)
    with pytest.raises(ValueError, match="subtract their centre"):
        echoloop.fpfh(near + offset, near, 1.0)


def test_normals_of_a_plane_face_the_sensor() -> None:
    grid = np.stack(np.meshgrid(np.arange(-2, 2, 0.1), np.arange(-2, 2, 0.1)), -1).reshape(-1, 2)
    plane = np.column_stack([np.full(len(grid), 5.0), grid])
    normals = echoloop.estimate_normals(plane, 0.5)
    assert np.allclose(normals, [-1, 0, 0], atol=1e-5)
    plane[7, 1] = np.nan
    assert (echoloop.estimate_normals(plane, 0.5)[7] == 0).all()
    with pytest.raises(ValueError, match="radius_m: expected a length above 0 m, found 0"):
        echoloop.estimate_normals(plane, 0.0)


def test_features_of_a_moved_cloud_match_themselves(clouds: Clouds) -> None:
    points = echoloop.voxel_downsample(clouds[0], 0.8)
    normals = echoloop.estimate_normals(points, 1.6)
    features = echoloop.fpfh(points, normals, 4.0)
    assert features.shape == (len(points), 33)
    order = np.random.default_rng(3).permutation(len(points))
    matches = echoloop.match_features(features, features[order])
    described = features.any(axis=1)
    assert len(matches) > 0.9 * described.sum()
    same = (matches[:, 0] == order[matches[:, 1]]).mean()
    assert same > 0.99
    with pytest.raises(ValueError, match=r"target: expected shape \(N, 33\)"):
        echoloop.match_features(points, features)
    with pytest.raises(ValueError, match="normals: expected .* rows, one a point"):
        echoloop.fpfh(points, normals[1:], 4.0)
