from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .typing import (
    Axis,
    Candidate,
    DetectedEchoes,
    FoundEchoes,
    Method,
    Path,
    Points,
    Progress,
    Result,
    Task,
)

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

__version__: str

@final
class Cloud:
    def __new__(cls, points: Points, *, range_sd_m: ArrayLike | None = None) -> Cloud: ...
    @property
    def points(self) -> NDArray[Any]: ...
    @property
    def range_sd_m(self) -> NDArray[np.float32] | None: ...
    @property
    def columns(self) -> dict[str, NDArray[Any]]: ...
    def transformed(self, target_from_source: NDArray[Any]) -> Cloud: ...
    def __len__(self) -> int: ...

@final
class Registration:
    @property
    def target_from_source(self) -> NDArray[np.float64]: ...
    @property
    def converged(self) -> bool: ...
    @property
    def stop(self) -> str: ...
    @property
    def method(self) -> str: ...
    @property
    def settings(self) -> dict[str, Any]: ...
    @property
    def iterations(self) -> int: ...
    @property
    def pairs(self) -> int: ...
    @property
    def inlier_fraction(self) -> float: ...
    @property
    def rmse_m(self) -> float: ...
    @property
    def covariance(self) -> NDArray[np.float64] | None: ...
    @property
    def covariance_about_m(self) -> list[float]: ...
    @property
    def overlap(self) -> float | None: ...
    @property
    def supported(self) -> float | None: ...
    @property
    def lead(self) -> float | None: ...
    @property
    def margin(self) -> float | None: ...
    @property
    def rival(self) -> NDArray[np.float64] | None: ...
    @property
    def unobservable_directions(self) -> NDArray[np.float64]: ...
    def __bool__(self) -> bool: ...

@final
class Target:
    def __new__(
        cls,
        points: Points,
        method: Literal["icp", "gicp"] = "icp",
        *,
        check: bool = True,
        **settings: float | None,
    ) -> Target: ...
    def register(
        self, source: Points, *, initial: NDArray[Any] | None = None
    ) -> Registration: ...
    @property
    def settings(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...

@final
class Detector:
    def __new__(cls, **settings: float | str) -> Detector: ...
    @property
    def samples(self) -> int: ...
    def process(self, codes: NDArray[np.uint16]) -> DetectedEchoes: ...

class Infeasible(ValueError): ...

@final
class Objective:
    def __new__(
        cls,
        settings: dict[str, Any] | None = None,
        *,
        config: Path | None = None,
        pairs: Literal["train", "test"] = "train",
    ) -> Objective: ...
    @property
    def axes(self) -> list[Axis]: ...
    @property
    def start(self) -> dict[str, float | str]: ...
    @property
    def start_point(self) -> list[float]: ...
    def evaluate(self, candidate: Candidate) -> dict[str, Any]: ...
    def __call__(self, candidate: Candidate) -> float: ...
    def __len__(self) -> int: ...

@final
class Scene:
    def __new__(
        cls,
        settings: dict[str, Any] | None = None,
        *,
        config: Path | None = None,
        town: int | None = None,
    ) -> Scene: ...
    @property
    def name(self) -> str: ...
    @property
    def vertices(self) -> NDArray[np.float32]: ...
    @property
    def triangles(self) -> NDArray[np.uint32]: ...

@final
class Sensor:
    def __new__(
        cls, settings: dict[str, Any] | None = None, *, config: Path | None = None
    ) -> Sensor: ...

@final
class Tuner:
    def __new__(
        cls, run: Path, settings: dict[str, Any] | None = None, *, config: Path | None = None
    ) -> Tuner: ...
    def ask(
        self, most: int | None = None, *, patience_s: float = 0.0, again: bool = False
    ) -> list[Task]: ...
    def tell(self, result: Result) -> bool: ...
    def worker(self) -> Worker: ...
    def close(self) -> None: ...
    def __enter__(self) -> Tuner: ...
    def __exit__(self, *_exception: object) -> None: ...
    @property
    def done(self) -> bool: ...
    @property
    def progress(self) -> Progress: ...
    @property
    def result(self) -> dict[str, Any] | None: ...

@final
class Worker:
    def __new__(
        cls, settings: dict[str, Any] | None = None, *, config: Path | None = None
    ) -> Worker: ...
    def work(self, task: Task) -> Result: ...

def scan(
    scene: Scene,
    sensor: Sensor,
    world_from_sensor: NDArray[Any] | None = None,
    *,
    seed: int | None = None,
) -> tuple[Cloud, NDArray[np.float64]]: ...
def register(
    target: Points,
    source: Points,
    method: Method = "auto",
    *,
    initial: NDArray[Any] | None = None,
    refine: bool = False,
    check: bool = True,
    **settings: float | str | None,
) -> Registration: ...
def read_cloud(path: Path) -> Cloud: ...
def write_cloud(path: Path, cloud: Points) -> None: ...
def voxel_downsample(points: Points, voxel_m: float) -> NDArray[Any]: ...
def estimate_normals(
    points: NDArray[Any], radius_m: float, max_neighbours: int = 30
) -> NDArray[np.float32]: ...
def fpfh(
    points: NDArray[Any], normals: NDArray[Any], radius_m: float, max_neighbours: int = 100
) -> NDArray[np.float32]: ...
def match_features(target: NDArray[Any], source: NDArray[Any]) -> NDArray[np.uint32]: ...
def find_echoes(
    waves: NDArray[Any],
    sample_ns: float,
    *,
    outgoing: NDArray[Any] | None = None,
    polarity: Literal["positive", "negative"] | None = None,
    snr: float = 5.0,
    floor: float = 0.05,
    max_echoes: int = 32,
    min_separation_ns: float = 0.0,
    response: bool = True,
) -> FoundEchoes: ...
