"""Measures ours against the peers and writes the tables: what `cargo xtask peers` runs."""

import argparse
import datetime
import json
import os
import subprocess
import sys
from pathlib import Path

import recall
import report
import scaling
import speed
from prose import wrapped

HERE = Path(__file__).parent
TITLE = "# Registration against its peers\n\nWritten by `cargo xtask peers`; how and why: [registration.md](registration.md).\n"


def script(name, out, *arguments, threads=1):
    """Runs a script in its own process, since its threads must be set before anything is imported."""
    settings = {"OMP_NUM_THREADS": str(threads), "RAYON_NUM_THREADS": str(threads), "OMP_WAIT_POLICY": "passive"}
    command = [sys.executable, str(HERE / name), "--out", str(out), *map(str, arguments)]
    subprocess.run(command, env={**os.environ, **settings}, check=True)
    return json.loads(out.read_text())


def measure_speed(args):
    """Measures with both numbers of threads."""
    voxels = {1: [0.3] if args.quick else [0.3, 0.1], 2: [0.3]}
    short = ["--repeats", 1] if args.quick else []
    data = ["--data", args.data] if args.data else []
    results = []
    for threads in [1] if args.quick else [1, 2]:
        arguments = ["--stages", args.stages, "--work", args.work / "clouds", "--threads", threads, *data, *short]
        arguments += ["--voxels", *voxels[threads]]
        results.append(script("speed.py", args.work / f"speed-{threads}.json", *arguments, threads=threads))
    result = {**results[0], "rows": [row for part in results for row in part["rows"]]}
    text = f"Rounds: {result['repeats']}, medians. Ratios above 1: we are faster. "
    text += "Other work shared the machine: CPU times are what to compare, and two threads seldom had two cores.\n\n"
    return text + "\n".join(report.speed_tables(result)) + "\n### Where a peer is ahead\n\n" + report.losses(result)


def measure_module(args):
    """Measures the calls of our module beside those of the peers' modules, on one thread."""
    short = ["--voxels", 0.3, "--repeats", 1] if args.quick else ["--voxels", 0.3, 0.1]
    data = ["--data", args.data] if args.data else []
    arguments = ["--module", "--work", args.work / "clouds", "--threads", 1, *data, *short]
    result = script("speed.py", args.work / "module.json", *arguments)
    text = f"Every row is a call from Python, in one process. Rounds: {result['repeats']}, medians.\n\n"
    text += report.overhead_table(result) + "\n" + "\n".join(report.speed_tables(result))
    return text + "\n### Where a peer's call is ahead\n\n" + report.losses(result)


def measure_recall(args):
    """Measures the recall on hard pairs."""
    short = ["--pairs", 2, "--baselines", 10, "--voxels", 0.5] if args.quick else []
    arguments = ["--stages", args.stages, "--echoloop", args.echoloop, "--work", args.work / "pairs", *short]
    return "\n".join(report.recall_tables(script("recall.py", args.work / "recall.json", *arguments)))


def measure_scaling(args):
    """Measures the growth from 5,000 to a million points."""
    short = ["--repeats", 1, "--sizes", 5000, 20000] if args.quick else []
    arguments = ["--stages", args.stages, "--work", args.work / "clouds", *short]
    return report.scaling_table(script("scaling.py", args.work / "scaling.json", *arguments))


PARTS = {
    "speed": (measure_speed, speed),
    "recall": (measure_recall, recall),
    "scaling": (measure_scaling, scaling),
    "python": (measure_module, speed),
}
NAMES = {"speed": "Speed", "recall": "Recall", "scaling": "Growth", "python": "From Python"}


def heading(args):
    """Machine, date and command."""
    options = "".join(f" --{part}" for part in args.parts if part != "speed") + (" --quick" if args.quick else "")
    versions = ", ".join((HERE / "requirements.txt").read_text().split())
    today = datetime.datetime.now(datetime.timezone.utc).date()
    return f"`cargo xtask peers{options}`, {today}, {report.machine()}. Peers: {versions}.\n"


def put(path, name, text):
    """Replaces a section of the page, or adds it; the other sections stay."""
    sections = {}
    for section in (path.read_text() if path.is_file() else "").split("\n## ")[1:]:
        title, _, content = section.partition("\n")
        sections[title] = content.strip("\n")
    sections[name] = text.strip("\n")
    parts = [f"\n## {title}\n\n{sections[title]}\n" for title in NAMES.values() if title in sections]
    path.write_text(wrapped(TITLE + "".join(parts)))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stages", type=Path, required=True, help="our example, built")
    parser.add_argument("--echoloop", type=Path, required=True, help="our command, built")
    parser.add_argument("--work", type=Path, required=True, help="folder for clouds, pairs and figures")
    parser.add_argument("--data", type=Path, default=os.environ.get("ECHOLOOP_DATA"), help="ECHOLOOP_DATA")
    parser.add_argument("--out", type=Path, required=True, help="the page")
    parser.add_argument("--quick", action="store_true", help="a minute, to see that all runs")
    parser.add_argument("--parts", nargs="+", choices=[*PARTS], default=["speed"])
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    for part in args.parts:
        measure, module = PARTS[part]
        put(args.out, NAMES[part], f"{module.__doc__.strip()}\n\n{heading(args)}\n{measure(args)}")
    print(f"wrote {args.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
