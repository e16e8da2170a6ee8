"""The waveform path beside numpy and scipy: the same steps on the same waveforms, one thread, taking turns.

256 waveforms of 1,024 samples, two echoes each, 15 taps. Reading: median, MAD, saturation and baseline, matched filter, threshold,
peaks, parabola, range of the strongest. Making: sin² pulses, shot and amplifier noise, gain, clip, quantisation. numpy works on
whole batches in 32-bit floats, as many waveforms at a time as is fastest; of scipy's filters the fastest. Ours does more on the
way: hysteresis, separation, widths, merged and clipped echoes, flags, in fixed point.
"""

import argparse
import datetime
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import scipy
from scipy import ndimage, signal

from common import median
from prose import wrapped
from report import machine, number, table
from speed import pin

BATCHES = [16, 64, 256]
FILTERS = {
    "lfilter": lambda x, taps: signal.lfilter(taps, 1, np.pad(x, ((0, 0), (0, len(taps) // 2))))[:, len(taps) // 2 :],
    "oaconvolve": lambda x, taps: signal.oaconvolve(x, taps[None], "same", axes=1),
    "correlate1d": lambda x, taps: ndimage.correlate1d(x, taps, mode="constant"),
}


class Reading:
    """Goes from codes to the range of every waveform's strongest echo; NaN without one."""

    def __init__(self, known):
        self.known, self.taps = known, np.array(known["taps"], np.float32) / 32_768

    def run(self, codes, convolve):
        known = self.known
        codes = codes.astype(np.float32)
        ambient = np.median(codes, axis=1, keepdims=True)
        sigma = 1.4826 * np.median(np.abs(codes - ambient), axis=1, keepdims=True)
        x = (np.minimum(codes, known["clip_code"]) - ambient) * np.float32(1 / 4096)
        y = convolve(x, self.taps)
        sigma_y = sigma * np.float32(known["noise_gain"] / 4096)
        threshold = np.maximum(known["floor"], known["snr_threshold"] * sigma_y)
        y[:, [0, -1]] = 0  # rows end to end: no peak lies across two
        flat = y.ravel()
        peaks, _ = signal.find_peaks(flat, height=np.repeat(threshold, y.shape[1]))
        rows, columns = np.divmod(peaks, y.shape[1])
        order = np.lexsort((flat[peaks], rows))  # the strongest of a row comes last
        last = np.flatnonzero(np.diff(rows[order], append=len(y)))
        rows, columns = rows[order][last], columns[order][last]
        before, top, after = (y[rows, columns + offset] for offset in (-1, 0, 1))
        delta = 0.5 * (before - after) / (before - 2 * top + after)
        ranges = np.full(len(y), np.nan)
        ranges[rows] = known["range_min_m"] + known["range_step_m"] * (columns + delta)
        return ranges


class Making:
    """Goes from echoes (ranges and currents) to codes."""

    def __init__(self, known):
        self.known, self.random = known, np.random.Generator(np.random.SFC64(1))

    def run(self, echoes, normal):
        known = self.known
        period, width = known["period_ns"], known["width_ns"]
        current = np.zeros(normal.shape, np.float32)
        begin = (2 * echoes[:, :, 0] / 0.299792458 - known["delay_ns"]) / period
        first = np.ceil(begin).astype(int)
        reach = np.arange(int(np.ceil(2 * width / period)))
        time_ns = (first[:, :, None] + reach - begin[:, :, None]) * period
        pulse = echoes[:, :, 1:] * np.sin(np.pi * time_ns / (2 * width)) ** 2 * (time_ns < 2 * width)
        for echo in range(echoes.shape[1]):
            current[np.arange(len(echoes))[:, None], first[:, echo, None] + reach] += pulse[:, echo]
        self.random.standard_normal(dtype=np.float32, out=normal)
        normal *= np.sqrt(np.float32(known["quiet_variance_ua2"]) + np.float32(known["shot_variance_ua"]) * current)
        normal += current
        normal += np.float32(known["quiet_ua"])
        normal *= np.float32((known["full_scale_code"] + 1) / known["full_scale_ua"])
        return np.rint(np.clip(normal, 0, known["full_scale_code"], out=normal), out=normal).astype(np.uint16)


class Ours:
    """One process of the program `waveform_path`, asked for one stage after another."""

    def __init__(self, binary, folder):
        path = folder / "waveforms.u16"
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        self.child = subprocess.Popen([str(binary), "--serve", str(path)], text=True, **pipes)
        self.known = json.loads(self.child.stdout.readline())
        self.codes = np.fromfile(path, "<u2").reshape(self.known["waveforms"], self.known["samples"])

    def cpu_ms(self, stage):
        self.child.stdin.write(stage + "\n")
        self.child.stdin.flush()
        answer = json.loads(self.child.stdout.readline())
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer["cpu_ms"]

    def close(self):
        self.child.stdin.close()
        self.child.wait()


def clocked(work):
    """One run of a stage; CPU time, ms."""
    start = time.process_time()
    work()
    return 1e3 * (time.process_time() - start)


def contestants(ours):
    """Functions by stage and contestant; each runs over all waveforms and returns CPU ms."""
    known, codes = ours.known, ours.codes
    reading, making = Reading(known), Making(known)
    echoes = np.array(known["echoes"], np.float32)

    def read(size, convolve):
        return lambda: clocked(lambda: [reading.run(codes[i : i + size], convolve) for i in range(0, len(codes), size)])

    def make(size):
        normal = np.empty((size, known["samples"]), np.float32)
        return lambda: clocked(lambda: [making.run(echoes[i : i + size], normal) for i in range(0, len(echoes), size)])

    return {
        "codes to echoes": {
            "Echoloop, fastest build": lambda: ours.cpu_ms("pipeline v3"),
            "Echoloop, baseline": lambda: ours.cpu_ms("pipeline baseline"),
            **{f"numpy, {name}, {size} at a time": read(size, f) for name, f in FILTERS.items() for size in BATCHES},
        },
        "returns to codes": {
            "Echoloop, fastest build": lambda: ours.cpu_ms("front end v3"),
            "Echoloop, baseline": lambda: ours.cpu_ms("front end baseline"),
            **{f"numpy, {size} at a time": make(size) for size in BATCHES},
        },
    }


def agreement(ours):
    """How far the two sides' ranges lie apart, mm: where something is clipped, where nothing is. In how many waveforms only one has
    an echo."""
    reading = Reading(ours.known)
    theirs = reading.run(ours.codes, FILTERS["lfilter"])
    mine = np.array([np.nan if value is None else value for value in ours.known["ranges_m"]])
    both = np.isfinite(mine) & np.isfinite(theirs)
    clipped = (ours.codes >= ours.known["clip_code"]).any(axis=1)
    apart = [1e3 * np.abs(mine - theirs)[both & kind] for kind in (clipped, ~clipped)]
    return apart, int((np.isfinite(mine) != np.isfinite(theirs)).sum()), int(both.sum())


def page(ours, runs, rounds):
    """The table: our two builds and the best of numpy."""
    samples = ours.codes.size
    rows = []
    for stage, times in runs.items():
        medians = {who: median(values) for who, values in times.items()}
        best = min((who for who in medians if who.startswith("numpy")), key=medians.get)
        us = medians["Echoloop, fastest build"]
        for who in ["Echoloop, fastest build", "Echoloop, baseline", best]:
            ratio = median(theirs / mine for theirs, mine in zip(times[who], times["Echoloop, fastest build"]))
            per_second = samples / medians[who] / 1e6
            rows.append([stage, who, number(per_second, 3), number(1e6 * medians[who] / samples, 2), number(ratio, 1)])
        print(f"{stage}: {samples / us / 1e6:.3f} Gsample/s, {best}: {samples / medians[best] / 1e6:.4f}, ratio {rows[-1][-1]}")
    apart, alone, both = agreement(ours)
    text = table(["step", "who", "Gsample/s", "ns a sample", "CPU over ours"], rows)
    text += f"\nMedians of {rounds} rounds; the last column is the median of the ratios of each round. "
    (clipped, whole) = apart
    text += f"{both} waveforms have an echo for both sides, {alone} for one only. Ranges lie {np.median(whole):.2f} mm apart (median) in the "
    text += f"{len(whole)} waveforms in which nothing is clipped. In the other {len(clipped)}, {np.median(clipped):.2f} mm: there numpy reads the "
    text += "top of the clipped pulse, ours its edges, and the strongest is not always the same echo.\n"
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--waveforms", type=Path, required=True, help="our program, built")
    parser.add_argument("--work", type=Path, required=True, help="folder for the waveforms")
    parser.add_argument("--out", type=Path, required=True, help="the page")
    parser.add_argument("--quick", action="store_true", help="seconds, to see that all runs")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    pin(1)
    ours, rounds = Ours(args.waveforms, args.work), 3 if args.quick else 31
    runs = {}
    for turn in range(1 + rounds):  # the first warms up
        for stage, works in contestants(ours).items():
            for who, work in works.items():
                took = work()
                if turn:
                    runs.setdefault(stage, {}).setdefault(who, []).append(took)
    beside = page(ours, runs, rounds)
    ours.close()
    growth = subprocess.run([str(args.waveforms), "--growth", *["--quick"][: args.quick]], text=True, check=True, stdout=subprocess.PIPE)
    head = f"`cargo xtask peers --waveforms{' --quick' * args.quick}`, {datetime.date.today()}, {machine()}. "
    head += f"numpy {np.__version__}, scipy {scipy.__version__}."
    sections = ["# What a waveform costs", head, "## Beside numpy and scipy", __doc__.strip(), beside]
    sections += ["## Growth", GROWTH, growth.stdout]
    args.out.write_text(wrapped("\n\n".join(part.strip() for part in sections) + "\n"))
    print(f"wrote {args.out}", file=sys.stderr)


GROWTH = """Time of one waveform and its ratio to the first row's, one core; rows take turns, of each the fastest round counts. Read the
ratios: the absolute times are this machine's.

All costs are linear in samples, with a constant part for thresholds, pulses and echoes. The filter is the one stage that grows with
the taps, by one multiply-add each; an echo costs a walk over its hill and a fixed number of exact filter outputs; beams are
independent, so that a scan costs as many times one beam."""

if __name__ == "__main__":
    main()
