"""Find the echoes of recorded waveforms and draw one with its echoes.

python waveforms_to_echoes.py waves.npy --sample-ns 1 --plot echoes.png

Without a file it makes some: two targets 3 m apart, in noise.
"""

import argparse
from pathlib import Path
from typing import Any

import echoloop
import numpy as np
from numpy.typing import NDArray

M_PER_NS = 0.299792458 / 2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("waves", type=Path, nargs="?", help="array (N, samples), .npy")
    parser.add_argument("--sample-ns", type=float, default=1.0)
    parser.add_argument("--row", type=int, default=0, help="the row to draw")
    parser.add_argument("--plot", type=Path, help="picture to write (needs matplotlib)")
    args = parser.parse_args()

    waves = np.load(args.waves) if args.waves else two_targets(args.sample_ns)
    echoes = echoloop.find_echoes(waves, args.sample_ns)
    print(f"{len(echoes['time_ns'])} echoes in {len(waves)} waveforms")
    own = echoes["waveform"] == args.row
    for time_ns, amplitude, snr in zip(
        echoes["time_ns"][own], echoes["amplitude"][own], echoes["snr"][own], strict=True
    ):
        print(f"{time_ns:8.2f} ns  {M_PER_NS * time_ns:7.3f} m  {amplitude:9.2f}  {snr:6.1f} sigma")
    if args.plot:
        plot(args.plot, waves[args.row], args.sample_ns, echoes["time_ns"][own])


def two_targets(sample_ns: float) -> NDArray[np.float64]:
    time_ns = sample_ns * np.arange(600)
    at_ns = np.linspace(200, 300, 50)[:, None]
    waves = np.random.default_rng(1).normal(120, 4, (50, 600))
    for height, later_ns in [(200, 0.0), (90, 3 / M_PER_NS)]:
        waves += height * np.exp(-0.5 * ((time_ns - at_ns - later_ns) / 2.5) ** 2)
    return waves


def plot(path: Path, wave: NDArray[Any], sample_ns: float, at_ns: NDArray[np.float64]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panel = pyplot.subplots(figsize=(10, 4))
    panel.plot(sample_ns * np.arange(len(wave)), wave, linewidth=0.8)
    for time_ns in at_ns:
        panel.axvline(time_ns, color="tab:red", linewidth=0.8)
    panel.set(xlabel="time, ns", ylabel="as recorded", title=f"{len(at_ns)} echoes")
    figure.savefig(path, dpi=120)
    print("wrote", path)


if __name__ == "__main__":
    main()
