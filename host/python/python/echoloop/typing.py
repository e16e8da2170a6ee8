"""Types of arguments and answers."""

from collections.abc import Sequence
from os import PathLike
from typing import Any, Literal, Protocol, TypedDict, Union

import numpy as np
from numpy.typing import NDArray


class HasPoints(Protocol):
    """Object with points, as of Open3D."""

    @property
    def points(self) -> Any:
        """Coordinates ``(N, 3)``, m, or a method that returns them."""


Points = Union[NDArray[np.float32], NDArray[np.float64], HasPoints]
"""Points of a cloud: ``(N, 3)``, m, or an object that has them."""

Method = Literal["auto", "icp", "gicp", "fgr", "mac"]
"""Registration method."""

Path = Union[str, "PathLike[str]"]
"""Path of a file."""


class DetectedEchoes(TypedDict):
    """Echoes of the sensor's detector: columns of equal length."""

    waveform: NDArray[np.uint32]
    range_m: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    width_ns: NDArray[np.float64]
    snr: NDArray[np.float64]
    range_sd_m: NDArray[np.float64]
    reflectivity: NDArray[np.float64]
    flags: list[tuple[str, ...]]


class FoundEchoes(TypedDict):
    """Echoes of recorded waveforms: columns of equal length."""

    waveform: NDArray[np.uint32]
    time_ns: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    width_ns: NDArray[np.float64]
    snr: NDArray[np.float64]
    flags: list[tuple[str, ...]]


class Axis(TypedDict):
    """Axis of a search."""

    name: str
    unit: str
    scale: str
    min: float
    max: float
    choices: Union[list[str], None]


Candidate = Union[dict[str, Any], Sequence[float], NDArray[np.float64]]
"""Parameters by name, or a point of the unit cube of the axes."""


class Search(TypedDict):
    """Search that a task is of: its version, configuration and traced scans."""

    program: str
    configuration: str
    scans: str


class Task(TypedDict):
    """Task of a Tuner: a pair to scan with a candidate's settings, and to register."""

    task: int
    search: Search
    scan: dict[str, Any]


class Result(TypedDict):
    """Result of a task."""

    task: int
    search: Search
    check: str
    result: dict[str, Any]


class Progress(TypedDict):
    """Registrations of a part of a search: how many there are, and how many are done."""

    stage: str
    of: int
    done: int
