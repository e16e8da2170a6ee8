"""The optimiser beside pycma and CyberAgent's cmaes: evaluations until a value is reached, from the same starts, and what is lost
after few noisy evaluations.

Evaluations are counted, not timed, and every run hangs on its seed alone: runs of the peers are kept in the work folder, so that a
measurement that was interrupted goes on.
"""

import argparse
import datetime
import json
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np

from prose import wrapped
from report import machine, number, table

DIMENSIONS = [5, 10, 20]
SIZES = [20, 40]
# Largest number of pycma's seeds: in 20 dimensions runs are long and medians need fewer.
SEEDS = {5: 201, 10: 201, 20: 31}
MIXED_SEEDS = {20: 15, 40: 3}
PYCMA, MARGIN, CATEGORIES = "pycma 4.5.0", "cmaes 0.13.1, CMAwM", "cmaes 0.13.1, CatCMAwM"


def ellipsoid(x):
    return float(np.sum(10 ** (6 * np.arange(len(x)) / (len(x) - 1)) * np.square(x)))


def turn(n):
    """Matrix of the same reflections as in our benches."""
    matrix = np.eye(n)
    for k in range(1, n + 1):
        v = np.sin([i * 7 + k * 13 for i in range(n)])
        matrix -= 2 * np.outer(v, v @ matrix) / (v @ v)
    return matrix


TURNS = {n: turn(n) for n in DIMENSIONS}


def rosenbrock(x):
    x = np.asarray(x)
    return float(np.sum(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2))


CONTINUOUS = {
    "sphere": lambda x: float(np.sum(np.square(x))),
    "ellipsoid": ellipsoid,
    "turned ellipsoid": lambda x: ellipsoid(TURNS[len(x)] @ np.asarray(x)),
    "rosenbrock": rosenbrock,
    "bent cigar": lambda x: float(x[0] ** 2 + 1e6 * np.sum(np.square(x[1:]))),
    "different powers": lambda x: float(np.sum(np.abs(x) ** (2 + 10 * np.arange(len(x)) / (len(x) - 1)))),
}
MIXED = {"SphereInt": 21, "EllipsoidInt": 21, "SphereOneMax": 2, "EllipsoidOneMax": 2}


def pycma(function, n, seed):
    """Evaluations to 1e-8, at most 2e4 n; None when it stopped before."""
    import cma

    mean, sigma = (0.0, 0.1) if function == "rosenbrock" else (3.0, 2.0)
    options = {"ftarget": 1e-8, "maxfevals": 20_000 * n, "seed": seed + 1, "verbose": -9}
    search = cma.CMAEvolutionStrategy([mean] * n, sigma, options)
    search.optimize(CONTINUOUS[function])
    return int(search.countevals) if search.best.f < 1e-8 else None


def mixed_value(function, real, whole):
    """Value at real and whole numbers, or bits."""
    value = ellipsoid if function.startswith("Ellipsoid") else CONTINUOUS["sphere"]
    if MIXED[function] == 2:
        return value(real) + float(np.sum(1 - whole))
    return value(np.concatenate([real, whole]))


def mixed_start(function, n, seed):
    """Mean of real and of whole numbers."""
    start = np.random.RandomState(seed).uniform(1, 3, n)
    if MIXED[function] == 2:
        start[n // 2 :] = 0.5
    return start


def cmawm(function, n, seed):
    """Evaluations to 1e-10, at most min(1e4 n, 2e5), with whole numbers by margin."""
    from cmaes import CMAwM

    half = n // 2
    low, high = (0, 1) if MIXED[function] == 2 else (-10, 10)
    bounds = np.array([[-np.inf, np.inf]] * half + [[low, high]] * half)
    steps = np.array([0.0] * half + [1.0] * half)
    search = CMAwM(mean=mixed_start(function, n, seed), sigma=1.0, bounds=bounds, steps=steps, seed=seed)

    def ask():
        told, asked = search.ask(), None
        asked, told = told
        return asked[:half], asked[half:], told

    return solved(search, ask, function, n)


def catcmawm(function, n, seed):
    """Evaluations to 1e-10, with bits as categories."""
    from cmaes import CatCMAwM

    half, bits = n // 2, MIXED[function] == 2
    start = mixed_start(function, n, seed)
    real = [[-np.inf, np.inf]] * half
    if bits:
        search = CatCMAwM(x_space=real, c_space=[2] * half, mean=start[:half], sigma=1.0, cov=np.eye(half), seed=seed)
    else:
        whole = [list(range(-10, 11))] * half
        search = CatCMAwM(x_space=real, z_space=whole, mean=start, sigma=1.0, cov=np.eye(n), seed=seed)

    def ask():
        told = search.ask()
        return told.x, (told.c[:, 1].astype(float) if bits else told.z), told

    return solved(search, ask, function, n)


def solved(search, ask, function, n):
    """Evaluations until the target; None when the cap comes first, or no axis is left."""
    evaluations = 0
    while evaluations < min(10_000 * n, 200_000):
        told, best = [], np.inf
        for _ in range(search.population_size):
            real, whole, asked = ask()
            value = mixed_value(function, real, whole)
            told.append((asked, value))
            best = min(best, value)
        evaluations += search.population_size
        if best <= 1e-10:
            return evaluations
        search.tell(told)
        # A private attribute of cmaes.
        inner = getattr(search, "_cma", search)
        if np.linalg.eigvalsh(inner._sigma**2 * inner._C).min() < 1e-30:
            return None
    return None


class Kept:
    """Stored runs of the peers, one a line."""

    def __init__(self, path):
        self.path, self.runs = path, {}
        if path.is_file():
            for line in path.read_text().splitlines():
                *key, evaluations = json.loads(line)
                self.runs[tuple(key)] = evaluations

    def runs_of(self, who, run, function, n, seeds):
        """Evaluations of every seed; runs those that are not stored yet."""
        for seed in range(seeds):
            key = (who, function, n, seed)
            if key not in self.runs:
                self.runs[key] = run(function, n, seed)
                with self.path.open("a") as file:
                    file.write(json.dumps([*key, self.runs[key]]) + "\n")
        return [self.runs[who, function, n, seed] for seed in range(seeds)]


def ours(program, part, seeds, first=0):
    """Our runs: rows of JSON."""
    command = [str(program), part, "--seeds", str(seeds), "--from", str(first)]
    done = subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE)
    return [json.loads(line) for line in done.stdout.splitlines()]


def medians(values, rounds=2_000):
    """Medians of bootstrap samples."""
    values = np.array(values, float)
    draw = np.random.default_rng(1).integers(0, len(values), (rounds, len(values)))
    return np.median(values[draw], axis=1)


def figure(runs):
    """Median with its 95 % interval, and the number of successes unless all succeeded."""
    reached = [run for run in runs if run is not None]
    if not reached:
        return f"– (0/{len(runs)})"
    low, high = np.percentile(medians(reached), [2.5, 97.5])
    success = "" if len(reached) == len(runs) else f" ({len(reached)}/{len(runs)})"
    return f"{number(np.median(reached), 0)} [{number(low, 0)}, {number(high, 0)}]{success}"


def ratio(mine, theirs):
    """Ratio of ours to theirs, with a 95 % interval by bootstrap of both medians."""
    mine, theirs = ([run for run in runs if run is not None] for runs in (mine, theirs))
    if not mine or not theirs:
        return "–"
    # The two sets of samples must be independent.
    drawn = medians(mine) / np.random.default_rng(2).permutation(medians(theirs))
    low, high = np.percentile(drawn, [2.5, 97.5])
    return f"{np.median(mine) / np.median(theirs):.3f} [{low:.3f}, {high:.3f}]"


def by_key(rows, *names):
    """Evaluations by row, in the order of the seeds."""
    found = {}
    for row in rows:
        found.setdefault(tuple(row[name] for name in names), []).append(row["evaluations"])
    return found


def continuous(args, kept):
    """Section on real numbers, compared with pycma."""
    mine = by_key(ours(args.optimiser, "continuous", args.seeds), "function", "n", "who")
    rows = []
    for function in CONTINUOUS:
        for n in DIMENSIONS:
            theirs = kept.runs_of(PYCMA, pycma, function, n, min(args.seeds, SEEDS[n]))
            tutorial, same = mine[function, n, "tutorial"], mine[function, n, "pycma"]
            figures = [figure(runs) for runs in (theirs, same, tutorial)]
            rows.append([function, n, *figures, ratio(same, theirs), ratio(tutorial, theirs)])
    head = ["function", "n", PYCMA, "ours, pycma's constants", "ours, tutorial's", "ratio, pycma's", "ratio, tutorial's"]
    return table(head, rows)


def mixed(args, kept):
    """Section on half whole numbers, compared with CMAwM and CatCMAwM."""
    mine = by_key(ours(args.optimiser, "mixed", args.mixed_seeds), "function", "n", "who")
    rows = []
    for n in SIZES:
        for function, count in MIXED.items():
            theirs = [kept.runs_of(who, run, function, n, min(args.mixed_seeds, MIXED_SEEDS[n])) for who, run in ((MARGIN, cmawm), (CATEGORIES, catcmawm))]
            own = [mine.get((function, n, who)) for who in ("rounded", "margin", "names")]
            figures = [figure(runs) if runs else "" for runs in (*theirs, *own)]
            best = own[2] or own[1]
            rows.append([function, n, *figures, ratio(best, theirs[1])])
    head = ["function", "N", MARGIN, CATEGORIES, "ours, rounded", "ours, margin", "ours, names", "ratio to CatCMAwM"]
    return table(head, rows)


def small(args):
    """Section on few noisy evaluations: loss of each arm, compared with the first on the same problems."""
    losses = {}
    # The first six hundred were used to choose the learning rate of names.
    for row in ours(args.optimiser, "small", args.problems, 100_000):
        losses.setdefault((row["right"], row["noise"], row["who"]), []).append(row["losses"])
    rows = []
    plain = next(iter(losses))[2]
    for (right, noise, who), runs in losses.items():
        logs = np.log(np.array(runs) + 0.003)
        apart = logs - np.log(np.array(losses[right, noise, plain]) + 0.003)
        cells = (cell(logs[:, k], apart[:, k], who == plain) for k in range(logs.shape[1]))
        rows.append([f"{100 * right:.0f} %", noise, who, *cells])
    return table(["starts right", "noise", "told as", "160 evaluations", "320", "480"], rows)


def cell(logs, apart, is_plain):
    """Geometric mean of the loss, and its difference to the plain arm in percent, with a 95 % interval over the problems."""
    loss = f"{np.exp(logs.mean()):.3f}"
    if is_plain:
        return loss
    draw = np.random.default_rng(1).integers(0, len(apart), (2_000, len(apart)))
    ends = [np.exp(apart.mean()), *np.exp(np.percentile(apart[draw].mean(axis=1), [2.5, 97.5]))]
    mean, low, high = (f"{100 * (end - 1):+.0f}" for end in ends)
    return f"{loss}, {mean} % [{low}, {high}]"


def page(args, kept):
    """The page, with the command and the machine."""
    seeds = f"{args.seeds} seeds each, {min(args.seeds, SEEDS[20])} of pycma's in 20 dimensions, start 3 in every coordinate and step size 2 (Rosenbrock 0 and 0.1), population 4 + ⌊3 ln n⌋, cap 2e4 n."
    head = f"`cargo xtask peers --optimiser{' --quick' * args.quick}`, {datetime.date.today()}, {machine()}."
    parts = [
        "# The optimiser against its peers",
        head,
        __doc__.strip(),
        "Medians with 95 % intervals by bootstrap of the median; where not every run succeeded, of those that did.",
        "## Real numbers",
        f"Evaluations to 1e-8. {seeds} Ratios: ours over pycma's, below 1 where ours needs fewer.",
        continuous(args, kept),
        "## Half whole numbers or bits",
        MIXED_NOTE.format(seeds=args.mixed_seeds),
        mixed(args, kept),
        "## Few evaluations and noise",
        SMALL_NOTE.format(problems=args.problems),
        small(args),
    ]
    return wrapped("\n\n".join(part.strip() for part in parts) + "\n")


MIXED_NOTE = """Evaluations to 1e-10 on the functions of "CMA-ES with Margin" (arXiv:2205.13482), as its authors' code defines them: N/2
real numbers, N/2 whole ones of −10 to 10 or bits; start uniform in 1 to 3, bits at ½, step size 1, cap min(1e4 N, 2e5). {seeds}
seeds; of the peers at most 15, and 3 for N = 40. CatCMAwM is given bits as categories. The ratio is that of our best way: names for bits, margin for
whole numbers; of 21 values, rounding does as well as either, and of two it fails. Ours has the tutorial's constants."""

SMALL_NOTE = """{problems} random problems of 10 real parameters, whole numbers of 4, 16 and 91 values and choices of 2, 3 and 4 names, which move
the optimum of the others; a share of the choices starts at the right name. 16 candidates a generation, step size 0.2. The search is told the
logarithm of the loss with normal noise of the size given; the table has the loss of its mean, without noise, and in brackets the 95 %
interval over the problems of the difference to the first row."""


def main():
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--optimiser", type=Path, required=True, help="our program, built")
    parser.add_argument("--work", type=Path, required=True, help="folder for the peers' runs")
    parser.add_argument("--out", type=Path, required=True, help="the page")
    parser.add_argument("--quick", action="store_true", help="a minute, to see that all runs")
    args = parser.parse_args()
    args.seeds, args.mixed_seeds, args.problems = (3, 2, 20) if args.quick else (201, 15, 1_002)
    args.work.mkdir(parents=True, exist_ok=True)
    args.out.write_text(page(args, Kept(args.work / "optimiser.jsonl")))
    print(f"wrote {args.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
