"""Echoes of recorded waveforms: ours, plain local maxima and scipy.signal.find_peaks, on the same records in one run.

    ECHOLOOP_DATA=... python3 benches/peers/waveform_peaks.py [target/release/echoloop]

Prints the tables of benches/record/waveforms.md. Needs numpy and scipy. An echo and a published place pair up within
2 ns, nearest first; what is left of either is an extra or a miss. Plateaus count at their middle, for everybody.
"""

import csv
import gzip
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from scipy.signal import find_peaks

TOLERANCE_NS = 2.0


def table(path):
    with gzip.open(path, "rt") as file:
        return [[float(cell) for cell in row] for row in list(csv.reader(file))[1:]]


def neon(folder):
    """Rows, outgoing rows and published places (from 0) of each pulse."""
    rows, outgoing = table(folder / "return_1_250.csv.gz"), table(folder / "outg_1_250.csv.gz")
    places = [[] for _ in rows]
    with open(folder / "decomposition_1_250.csv") as file:
        for line in list(csv.reader(file))[1:]:
            places[int(float(line[0])) - 1].append(float(line[2]) - 1.0)
    return rows, outgoing, places


def adapt(path, calls):
    """Rows and expected places of the records whose counts agree."""
    records = [r for r in json.loads(path.read_text()) if r["calls"] == calls]
    records = [r for r in records if r["expected_count"] == len(r["expected_peaks"])]
    return [r["samples"] for r in records], [[p["location"][0] for p in r["expected_peaks"]] for r in records]


def trimmed(row):
    row = np.trim_zeros(np.asarray(row, float), "b")
    return row if len(row) else np.zeros(1)


def local_maxima(row):
    row = trimmed(row)
    return [float(p) for p in plateau_middles(row, find_peaks(row, plateau_size=1)[1])]


def plateau_middles(_row, found):
    return (found["left_edges"] + found["right_edges"]) / 2


def by_prominence(share):
    """find_peaks with a prominence and height relative to the record's range."""

    def find(row):
        row = trimmed(row)
        least = share * np.ptp(row)
        return [float(p) for p in plateau_middles(row, find_peaks(row, height=row.min() + least, prominence=least, plateau_size=1)[1])]

    return find


def write(path, rows):
    path.write_text("".join(",".join(f"{v:g}" for v in row) + "\n" for row in rows))


def ours(binary, rows, outgoing=None, more=()):
    with tempfile.TemporaryDirectory() as folder:
        waves, pulses = Path(folder) / "waves.csv", Path(folder) / "outgoing.csv"
        write(waves, rows)
        command = [binary, "echoes", waves, "--sample-ns", "1", "--json", *more]
        if outgoing:
            write(pulses, outgoing)
            command += ["--outgoing", pulses]
        lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    return [[echo["time_ns"] for echo in json.loads(line)["echoes"]] for line in lines]


def pairs(found, places):
    near = sorted((abs(a - b), i, j) for i, a in enumerate(found) for j, b in enumerate(places))
    used, met, errors = set(), set(), []
    for distance, i, j in near:
        if distance <= TOLERANCE_NS and i not in used and j not in met:
            used.add(i)
            met.add(j)
            errors.append(found[i] - places[j])
    return errors


def line(name, found, places):
    kept = [(f, p) for f, p in zip(found, places) if p]
    errors = [e for f, p in kept for e in pairs(f, p)]
    truth, echoes = sum(len(p) for _, p in kept), sum(len(f) for f, _ in kept)
    counts = sum(len(f) == len(p) for f, p in kept)
    hits = len(errors)
    print(f"| {name} | {hits} of {truth} | {100 * hits / truth:.1f} % | {echoes - hits} | {counts} of {len(kept)} | {np.std(errors):.2f} ns |")


HEADER = "| | within 2 ns | recall | extra | right count | spread of hits |\n|---|---|---|---|---|---|"


def main():
    data = os.environ.get("ECHOLOOP_DATA")
    if not data:
        sys.exit("skipped: ECHOLOOP_DATA is not set")
    binary = sys.argv[1] if len(sys.argv) > 1 else "target/release/echoloop"
    rows, outgoing, places = neon(Path(data) / "waveforms_neon")
    with_outgoing = ours(binary, rows, outgoing)
    print("NEON\n\n" + HEADER)
    line("plain local maxima", [local_maxima(r) for r in rows], places)
    for share in (0.01, 0.02, 0.05):
        line(f"`find_peaks`, height and prominence {share:g}", [by_prominence(share)(r) for r in rows], places)
    line("ours", ours(binary, rows), places)
    line("ours, `--outgoing`", with_outgoing, places)
    line("ours, `--no-response`", ours(binary, rows, more=["--no-response"]), places)
    line("ours, `--no-response --outgoing`", ours(binary, rows, outgoing, ["--no-response"]), places)
    confusion = Counter((len(p), len(f)) for f, p in zip(with_outgoing, places) if p)
    print("\npublished, found: pulses\n" + ", ".join(f"{p}, {f}: {n}" for (p, f), n in sorted(confusion.items())))
    for calls in ("guess_peaks", "find_peaks"):
        rows, places = adapt(Path(data) / "waveform_peaks_adapt" / "waveforms_expected_peaks.json", calls)
        print(f"\nADAPT, {calls}\n\n" + HEADER)
        line("plain local maxima", [local_maxima(r) for r in rows], places)
        for share in (0.01, 0.05):
            line(f"`find_peaks`, height and prominence {share:g}", [by_prominence(share)(r) for r in rows], places)
        line("ours", ours(binary, rows), places)


if __name__ == "__main__":
    main()
