"""Echoes of the sensor's detector and of recordings."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import echoloop
import numpy as np
import pytest
from numpy.typing import NDArray

LIGHT_M_PER_NS = 0.299792458 / 2


def waveforms(heights: list[float], at: float) -> NDArray[np.uint16]:
    """Pulses of 5 ns at a sample, over 200 codes of ambient light and noise of 4."""
    time = np.arange(800)
    pulse = np.exp(-0.5 * ((time - at) / 2.1) ** 2)
    noise = np.random.default_rng(5).normal(200, 4, (len(heights), 800))
    return (np.outer(heights, pulse) + noise).round().astype(np.uint16)


def test_the_detector_finds_pulses_at_their_range_and_height() -> None:
    detector = echoloop.Detector()
    assert detector.samples == 800
    echoes = detector.process(waveforms([800, 0, 1600], 300))
    assert echoes["waveform"].tolist() == [0, 2]
    sample_m = 119 / 800  # 1 to 120 m in 800 bins
    assert np.allclose(echoes["range_m"], 1 + 300 * sample_m, atol=0.5)
    assert np.ptp(echoes["range_m"]) < 0.01
    assert np.allclose(echoes["amplitude"], [800 / 4096, 1600 / 4096], rtol=0.05)
    assert (echoes["snr"] > 50).all() and echoes["flags"] == [(), ()]
    assert len({len(column) for column in echoes.values()}) == 1  # type: ignore[arg-type]


def test_settings_of_the_detector_are_those_of_the_sensor() -> None:
    two = waveforms([800], 300) + waveforms([1600], 500) - np.uint16(200)
    def near(choice: str) -> float:
        return float(echoloop.Detector(echo_choice=choice).process(two)["range_m"][0])
    assert near("first") < 50 < near("last") == near("strongest")
    both = echoloop.Detector(echoes=2).process(two)
    assert both["waveform"].tolist() == [0, 0]
    assert echoloop.Detector(waveform_resolution=400).samples == 400


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"gain": 99}, "gain: gain 99 dB is above its maximum 30 dB"),
        ({"gian": 9}, "unknown field `gian`, expected one of `power`"),
        ({"timing": "cdf"}, "timing: .*expected one of .*cfd"),
        ({"shots": 2}, "shots: expected 1"),
    ],
)
def test_a_bad_setting_is_named(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        echoloop.Detector(**settings)


def test_bad_codes_are_named() -> None:
    detector = echoloop.Detector()
    with pytest.raises(ValueError, match="codes: expected 800 samples a waveform, found 10"):
        detector.process(np.zeros((3, 10), np.uint16))
    with pytest.raises(TypeError, match="codes: expected uint16, found float64"):
        detector.process(np.zeros((3, 800)))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="codes: expected shape"):
        detector.process(np.zeros((2, 3, 800), np.uint16))
    assert len(detector.process(np.zeros((0, 800), np.uint16))["range_m"]) == 0


@pytest.mark.parametrize("kind", [np.uint16, np.float32, np.float64])
def test_echoes_of_a_recording_are_those_of_the_program(
    run: Callable[..., str], tmp_path: Path, kind: type
) -> None:
    waves: NDArray[Any] = waveforms(list(np.linspace(20, 3000, 60)), 120).astype(kind)
    np.save(tmp_path / "waves.npy", waves)
    told = run("echoes", tmp_path / "waves.npy", "--sample-ns", "0.5", "--json", "-q")
    rows = [json.loads(line) for line in told.splitlines()]
    expected = [(row["waveform"], echo) for row in rows for echo in row["echoes"]]
    found = echoloop.find_echoes(waves, 0.5)
    assert len(expected) > 40
    assert found["waveform"].tolist() == [row for row, _ in expected]
    for name in ("time_ns", "amplitude", "width_ns", "snr"):
        assert found[name].tolist() == [echo[name] for _, echo in expected]
    assert found["flags"] == [tuple(echo["flags"]) for _, echo in expected]


def test_bad_options_of_the_search_are_named() -> None:
    waves = waveforms([800], 300)
    cases: list[tuple[dict[str, Any], str]] = [
        ({"sample_ns": 0.0}, "sample_ns = 0 must be"),
        ({"snr": 0.5}, "snr = 0.5 must be 1 to 250"),
        ({"polarity": "up"}, "polarity: expected positive or negative"),
        ({"outgoing": waveforms([1, 2], 9)}, "outgoing: expected 1 row or 1"),
    ]
    for options, said in cases:
        with pytest.raises(ValueError, match=said):
            echoloop.find_echoes(**{"waves": waves, "sample_ns": 1.0, **options})
