"""Registration: the numbers of the program, from arrays of every kind."""

import threading
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import echoloop
import numpy as np
import pytest
from numpy.typing import NDArray

Clouds = tuple[echoloop.Cloud, echoloop.Cloud]
Document = Callable[..., dict[str, Any]]


@pytest.mark.parametrize(
    ("method", "refine", "flags"),
    [
        ("auto", False, []),
        ("icp", False, []),
        ("gicp", False, ["--voxel-m", "0.4"]),
        ("fgr", True, []),
        ("mac", False, []),
    ],
)
def test_the_motion_is_that_of_the_program_to_the_last_bit(
    clouds: Clouds, registered: Document, method: Any, refine: bool, flags: list[str]
) -> None:
    told = registered("--method", method, *(["--refine"] if refine else []), *flags)
    settings: dict[str, Any] = {"voxel_m": 0.4} if flags else {}
    found = echoloop.register(*clouds, method, refine=refine, **settings)
    assert found.target_from_source.tolist() == told["target_from_source"]
    assert bool(found) == found.converged == told["converged"]
    assert (found.iterations, found.pairs, found.rmse_m) == (
        told["iterations"], told["pairs"], told["rmse_m"],
    )
    covariance = None if found.covariance is None else found.covariance.tolist()
    assert covariance == told["covariance"]
    assert (found.lead, found.supported, found.overlap) == (
        told["lead"], told["supported"], told["known"],
    )
    assert len(found.unobservable_directions) == len(told["open_directions"])
    assert found.method == method and method in repr(found)


def test_arrays_of_every_layout_give_the_same(clouds: Clouds) -> None:
    target, source = (cloud.points for cloud in clouds)
    assert target.dtype == np.float32 and target.shape == (len(clouds[0]), 3)
    expected = echoloop.register(target, source, "icp").target_from_source
    wide = np.zeros((len(source), 6), np.float32)
    wide[:, ::2] = source
    locked = source.copy()
    locked.flags.writeable = False
    homogeneous = np.column_stack([source, np.ones(len(source))])
    layouts: list[Any] = [
        source.astype(np.float64),
        np.asfortranarray(source),
        wide[:, ::2],
        source[::-1][::-1],
        locked,
        SimpleNamespace(points=source),
        SimpleNamespace(points=lambda: homogeneous),
        echoloop.Cloud(source),
    ]
    for same in layouts:
        found = echoloop.register(target, same, "icp").target_from_source
        assert (found == expected).all()


def test_points_that_are_no_echo_are_left_out(clouds: Clouds) -> None:
    target, source = (cloud.points for cloud in clouds)
    none = np.array([[np.nan, 0, 0], [0, 0, 0], [0, np.inf, 1]], np.float32)
    more = np.concatenate([none[:1], source, none[1:]])
    expected = echoloop.register(target, source, "icp").target_from_source
    assert (echoloop.register(target, more, "icp").target_from_source == expected).all()
    assert len(echoloop.Cloud(more)) == len(source)


def test_survey_coordinates_keep_their_digits(clouds: Clouds) -> None:
    target, source = (cloud.points.astype(np.float64) for cloud in clouds)
    offset = np.array([500_000.0, 5_400_000.0, 300.0])
    expected = echoloop.register(target, source)
    found = echoloop.register(target + offset, source + offset)
    moved = found.target_from_source[:3] @ [*offset, 1.0] - offset
    assert np.allclose(moved, expected.target_from_source[:3, 3], atol=0.02)
    centre = found.target_from_source[:3] @ [*(source.mean(axis=0) + offset), 1.0]
    assert np.allclose(found.covariance_about_m, centre, atol=0.01)
    assert echoloop.Cloud(target + offset).points.dtype == np.float64


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"target": np.zeros((3, 50))}, ValueError, r"target: .*\(N, 3\), found \(3, 50\): trans"),
        ({"source": np.zeros((0, 3))}, ValueError, "source: expected a point that is an echo"),
        ({"source": np.zeros((9, 3))}, ValueError, "source: .*0 non-finite and 9 at range 0"),
        ({"source": np.ones((9, 3), int)}, TypeError, "source: .*float64, found int64"),
        ({"source": np.full((9, 3), 1e8)}, ValueError, "source: point 0.*subtract a common off"),
        ({"source": "scan.ply"}, ValueError, r"source: expected shape \(N, 3\), found \(\)"),
        ({"method": "icpp"}, ValueError, 'method: expected one of icp,.* found "icpp"'),
        ({"method": "fgr", "initial": np.eye(4)}, ValueError, "takes no initial guess"),
        ({"method": "icp", "refine": True}, ValueError, "refine goes with"),
        ({"initial": np.eye(3)}, ValueError, "initial: expected shape"),
        ({"initial": 2 * np.eye(4)}, ValueError, "initial: "),
        ({"voxel": 1}, TypeError, "voxel is no setting of any method"),
        ({"voxel_m": "0.2"}, TypeError, "voxel_m: expected a number"),
        ({"voxel_m": -1}, ValueError, "voxel_m is -1, expected a length above 0 m"),
        ({"method": "icp", "feature_radius_m": 1}, ValueError, "is no setting of icp"),
        ({"method": "fgr", "mode": "open"}, ValueError, "mode: expected one of annealed, open3d"),
    ],
)
def test_a_bad_argument_is_named(
    clouds: Clouds, change: dict[str, Any], error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        echoloop.register(**{"target": clouds[0], "source": clouds[1], **change})


def test_a_pair_that_does_not_register_is_false_and_says_why(clouds: Clouds) -> None:
    line = np.linspace([1, 0, 0], [2, 0, 0], 50)
    found = echoloop.register(line, line, "icp")
    assert not found and "too few" in found.stop
    assert (found.target_from_source == np.eye(4)).all()
    far = np.eye(4)
    far[0, 3] = 40.0
    assert not echoloop.register(*clouds, "icp", initial=far)


def test_without_the_check_a_wrong_motion_is_believed(clouds: Clouds) -> None:
    far = np.eye(4)
    far[0, 3] = 40.0
    settings: dict[str, Any] = {"voxel_m": 0.3, "max_pair_distance_m": 2.0}
    checked = echoloop.register(*clouds, "icp", initial=far, **settings)
    believed = echoloop.register(*clouds, "icp", initial=far, check=False, **settings)
    assert not checked and believed and believed.supported is None
    assert (checked.target_from_source == believed.target_from_source).all()
    prepared = echoloop.Target(clouds[0], "icp", check=False, **checked.settings)
    found = prepared.register(clouds[1], initial=far)
    assert (found.target_from_source == believed.target_from_source).all()
    with pytest.raises(ValueError, match="auto chooses by the check"):
        echoloop.register(*clouds, check=False)


def test_a_prepared_target_serves_many_sources(clouds: Clouds) -> None:
    target, source = clouds
    assert target.range_sd_m is not None
    prepared = echoloop.Target(target, "gicp", voxel_m=0.3)
    assert prepared.settings["voxel_m"] == 0.3 and len(prepared) < len(target)
    expected = echoloop.register(target, source, "gicp", **prepared.settings)
    for moved_m in [0.0, 0.2]:
        motion = np.eye(4)
        motion[0, 3] = moved_m
        found = prepared.register(source.transformed(motion))
        assert found.converged == expected.converged
        back = found.target_from_source @ motion
        assert np.allclose(back, expected.target_from_source, atol=5e-3)
    with pytest.raises(ValueError, match="prepared for icp or gicp, not for mac"):
        echoloop.Target(target, "mac")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="points: expected shape"):
        echoloop.Target(np.zeros(3))


def registered(clouds: tuple[NDArray[Any], NDArray[Any]]) -> NDArray[np.float64]:
    return echoloop.register(*clouds).target_from_source


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # of fork, which is meant
def test_a_process_that_is_forked_off_has_threads_of_its_own(clouds: Clouds) -> None:
    points = clouds[0].points, clouds[1].points
    expected = registered(points)
    with get_context("fork").Pool(2) as pool:
        for found in pool.map_async(registered, [points] * 3).get(timeout=60):
            assert (found == expected).all()


def test_eight_threads_find_what_one_finds(clouds: Clouds) -> None:
    expected = echoloop.register(*clouds, "icp").target_from_source
    found: list[np.ndarray[Any, Any]] = []
    work = lambda: found.append(echoloop.register(*clouds, "icp").target_from_source)  # noqa: E731
    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8 and all((motion == expected).all() for motion in found)


def test_ten_thousand_calls_keep_no_memory() -> None:
    points = np.random.default_rng(1).normal(size=(200, 3)).astype(np.float32)

    def calls(count: int) -> int:
        for _ in range(count):
            cloud = echoloop.Cloud(points)
            assert len(cloud.points) == 200
            echoloop.voxel_downsample(points, 0.5)
            echoloop.register(cloud, points, "icp", voxel_m=0.5, max_iterations=2)
            with pytest.raises(ValueError, match="method"):
                echoloop.register(cloud, points, "none")  # type: ignore[arg-type]
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return 4096 * pages

    if not Path("/proc/self/statm").exists():
        pytest.skip("no /proc")
    before = calls(1_000)
    # 10,000 leaks of 2.4 kB, the points of a cloud, are 24 MB.
    assert calls(10_000) - before < 8e6


def test_ten_million_points_are_thinned() -> None:
    points = np.random.default_rng(2).uniform(-50, 50, (10_000_000, 3)).astype(np.float32)
    thin = echoloop.voxel_downsample(points, 10.0)
    assert thin.shape == (1000, 3)
    assert np.abs(thin.mean(axis=0)).max() < 0.1
