"""Tables from the measurements: Markdown, with machine, date and command."""

import os
import platform
from pathlib import Path

from common import median
from recall import LEAST_OVERLAP, SUCCESS_DEG, SUCCESS_M
from speed import OURS, STREET

TITLES = {
    "voxel": "voxels",
    "normals": "normals, with the search",
    "fpfh": "FPFH from normals, with the search",
    "describe": "voxels to FPFH, one cloud",
    "match": "mutual matching",
    "icp_align": "ICP to plane, prepared",
    "icp": "ICP to plane, from clouds",
    "gicp_align": "GICP, prepared",
    "gicp": "GICP, from clouds",
    "fgr_solve": "FGR from matches",
    "mac_solve": "MAC from matches",
    "fgr": "global, from clouds: FGR",
    "mac": "global, from clouds: MAC",
    "fgr_refined": "FGR, then ICP",
    "mac_refined": "MAC, then ICP",
    "fgr_gicp": "FGR, then GICP",
    "mac_gicp": "MAC, then GICP",
    "fgr_suggested": "FGR, then ICP, suggested settings",
    "mac_suggested": "MAC, then ICP, suggested settings",
    "icp_target": "ICP to plane, target prepared",
    "gicp_target": "GICP, target prepared",
    "auto": "`auto`: no settings, no guess, with the check",
    "icp_checked": "ICP to plane, from clouds, with the check",
    "icp_target_checked": "ICP to plane, target prepared, with the check",
    "gicp_checked": "GICP, from clouds, with the check",
    "gicp_target_checked": "GICP, target prepared, with the check",
    "fgr_checked": "global, from clouds: FGR, with the check",
    "mac_checked": "global, from clouds: MAC, with the check",
}

TRUTH_M = {STREET: 0.05}  # how far the truth itself may be off


def number(value, digits):
    """A figure with its significant digits; a dash without one."""
    return "–" if value is None or value != value else f"{value:,.{digits}f}"


def milliseconds(value):
    """A figure with three digits."""
    return number(value, 0 if value >= 100 else 1 if value >= 10 else 2)


def table(head, rows):
    """A table in Markdown."""
    lines = [head, *rows]
    text = ["| " + " | ".join(map(str, line)) + " |" for line in lines]
    return "\n".join([text[0], "|" + "---|" * len(head), *text[1:]]) + "\n"


def machine():
    """Processor, cores, system."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        named = [line.split(":")[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")]
        model = named[0] if named else model
    return f"{os.cpu_count()} cores of a shared {model}{vectors()}, {platform.system()}"


def vectors():
    """Vector unit of the processor."""
    info = Path("/proc/cpuinfo")
    flags = info.read_text().split() if info.is_file() else []
    named = [name for flag, name in (("avx2", "AVX2"), ("avx512f", "AVX-512")) if flag in flags]
    return " with " + " and ".join(named) if named else ""


def with_mac(rows):
    """Repeats the rows of FGR's peers for our MAC, which has the same peers."""
    theirs = [row for row in rows if row["stage"] == "fgr" and row["who"] != OURS]
    ours = [row for row in rows if row["stage"] == "mac"]
    return [row for row in rows if row["stage"] != "mac"] + [{**row, "stage": "mac"} for row in theirs if ours] + ours


def with_checked(rows):
    """Repeats the rows of the peers, none of which has a check, for ours with it."""
    end = "_checked"
    stages = {row["stage"] for row in rows if row["stage"].endswith(end)}
    theirs = [row for row in rows if row["stage"] + end in stages and row["who"] != OURS]
    return rows + [{**row, "stage": row["stage"] + end} for row in theirs]


def speed_tables(result):
    """A table for each pair, voxel and number of threads."""
    rows = with_checked(with_mac(result["rows"]))
    keys = dict.fromkeys((row["pair"], row["voxel_m"], row["threads"]) for row in rows)
    for pair, voxel_m, threads in keys:
        chosen = [row for row in rows if (row["pair"], row["voxel_m"], row["threads"]) == (pair, voxel_m, threads)]
        plural = "thread" if threads == 1 else "threads"
        yield f"### {pair}, voxel {voxel_m} m, {threads} {plural}\n\n{speed_table(chosen)}"


def speed_table(rows):
    """Table by stage; the ratio of theirs to ours is above 1 when ours is faster."""
    ours = {row["stage"]: row for row in rows if row["who"] == OURS}
    lines = []
    for stage in TITLES:
        measured = [row for row in rows if row["stage"] == stage]
        lines += [speed_line(row, ours.get(stage) if row["who"] != OURS else None) for row in measured]
    head = ["stage", "who", "in → out", "CPU ms", "wall ms", "CPU theirs/ours", "wall", "error cm", "error °"]
    return table(head, lines)


def speed_line(row, ours):
    ratios = [f"**{row[key] / ours[key]:.2f}**" if ours else "" for key in ("cpu_ms", "wall_ms")]
    translation = row["translation_m"]
    return [
        TITLES[row["stage"]],
        row["who"],
        f"{row['n_in']:,} → {row['n_out']:,}" if row["n_out"] else f"{row['n_in']:,}",
        milliseconds(row["cpu_ms"]),
        milliseconds(row["wall_ms"]),
        *ratios,
        number(None if translation is None else 100 * translation, 1),
        number(row["rotation_deg"], 2),
    ]


def losses(result):
    """Rows in which a peer is faster or nearer to the truth than our same stage, within the truth's accuracy."""
    rows, found = with_checked(with_mac(result["rows"])), []
    key = lambda row: (row["pair"], row["voxel_m"], row["threads"], row["stage"])  # noqa: E731
    ours = {key(row): row for row in rows if row["who"] == OURS}
    for row in rows:
        mine = ours.get(key(row))
        if mine is None or row["who"] == OURS:
            continue
        where = f"{TITLES[row['stage']]}, {row['pair']}, {row['voxel_m']} m, {row['threads']} thread(s): {row['who']}"
        if row["cpu_ms"] < mine["cpu_ms"]:
            found.append(f"- {where} takes {row['cpu_ms'] / mine['cpu_ms']:.2f} of our CPU time")
        if row["translation_m"] is not None and mine["translation_m"] is not None:
            known = mine["translation_m"] > TRUTH_M.get(row["pair"], 0.0)
            if known and row["translation_m"] < mine["translation_m"]:
                both = f"{100 * row['translation_m']:.1f} against our {100 * mine['translation_m']:.1f} cm"
                found.append(f"- {where} ends nearer to the truth, {both}")
    return "\n".join(found) + "\n" if found else "Nowhere in these tables.\n"


def overhead_table(result):
    """Least times of clouds from arrays, and of an empty call."""
    lines = [[kind, who, number(least, 1)] for who, kind, least in result["overhead"]]
    return table(["20,000 points", "who", "least µs"], sorted(lines))


def recall_tables(result):
    """Recall by method and voxel, then by distance, then by kind of place."""
    unrelated = [row for row in result["rows"] if "unrelated" in row]
    related = [row for row in result["rows"] if "unrelated" not in row]
    pairs = {identity(row): row for row in related}
    counted = [row for row in related if "who" in row]
    judged = len({identity(row) for row in counted})
    yield (
        f"{judged} of {len(pairs)} pairs of scans overlap by {LEAST_OVERLAP:.0%}, {len({i[:3] + i[4:] for i in pairs})} pairs of "
        f"places at two densities. Success is {SUCCESS_M:g} m and {SUCCESS_DEG:g}°; errors "
        "are over successes, so that whoever succeeds on harder pairs has larger ones: the last errors are those of the pairs on "
        "which all refined methods succeed at that voxel. CPU is the median of a pair.\n"
    )
    methods = list(dict.fromkeys(row["who"] for row in counted))
    voxels = sorted({row["voxel_m"] for row in counted}, key=lambda voxel: (isinstance(voxel, str), voxel))
    of = lambda who, voxel_m: [row for row in counted if (row["who"], row["voxel_m"]) == (who, voxel_m)]  # noqa: E731
    head = ["method", "voxel m", "recall", "mean error", "median error", "median error, common pairs", "CPU ms"]
    runs = [(who, voxel_m) for who in methods for voxel_m in voxels if of(who, voxel_m)]
    good = lambda who, voxel_m: {identity(row) for row in of(who, voxel_m) if row["success"]}  # noqa: E731
    common = {v: set.intersection(*(good(who, w) for who, w in runs if w == v and "+" in who)) for v in voxels}
    yield table(head, [recall_line(*run, of(*run), common[run[1]]) for run in runs])
    mine, theirs = "Echoloop FGR + ICP", "KISS-Matcher + GICP"
    lead = lambda v: (v, len(good(mine, v) - good(theirs, v)), len(good(theirs, v) - good(mine, v)), len(common[v]))  # noqa: E731
    yield f"Pair by pair, {mine} against {theirs}:\n"
    head = ["voxel m", "only ours is right", "only theirs is right", "pairs common to all refined"]
    yield table(head, [lead(v) for w, v in runs if w == theirs])
    best = {who: max((v for w, v in runs if w == who), key=lambda voxel_m: share(of(who, voxel_m))) for who in methods}
    yield "Each at the voxel of its best recall:\n"
    for key, title in (("baseline_m", "{:g} m apart"), ("kind", "{}"), ("heading_deg", "±{:g}°"), ("scanner", "{}")):
        values = list(dict.fromkeys(row[key] for row in counted))
        lines = []
        for who in methods:
            rows = of(who, best[who])
            parts = [[row for row in rows if row[key] == value] for value in values]
            lines.append([f"{who}, {voxel_name(best[who])}", *(f"{share(part):.1f} %" if part else "–" for part in parts)])
        yield table(["method", *map(title.format, values)], lines)
    yield "### What ours say\n"
    count = len({identity(row) for row in unrelated})
    yield (
        f"Of right motions (within {SUCCESS_M:g} m and {SUCCESS_DEG:g}°), how many were called no consensus; of wrong ones, and of "
        f"{count} pairs from two towns, how many were called found (converged).\n"
    )
    spoken = [run for run in runs if any(row["stop"] for row in of(*run))]
    strangers = lambda who, voxel_m: [r for r in unrelated if (r["who"], r["voxel_m"]) == (who, voxel_m)]  # noqa: E731
    head = ["method", "voxel m", "right, refused", "right, other stops", "wrong, called found", "unrelated, called found"]
    yield table(head, [said_line(*run, of(*run), strangers(*run)) for run in spoken])


def voxel_name(voxel_m):
    return voxel_m if isinstance(voxel_m, str) else f"{voxel_m:g} m"


def said_line(who, voxel_m, rows, strangers):
    """Table of how often a method's own verdict was wrong."""
    right, wrong = ([row for row in rows if row["success"] == good] for good in (True, False))
    said = lambda rows, *stops: f"{sum(row['stop'] in stops for row in rows)} of {len(rows)}"  # noqa: E731
    others = {row["stop"] for row in rows} - {"Still", "NoConsensus"}
    return [
        who,
        voxel_m,
        said(right, "NoConsensus"),
        said(right, *others),
        said(wrong, "Still"),
        said(strangers, "Still"),
    ]


def identity(row):
    return row["kind"], row["baseline_m"], row["heading_deg"], row["scanner"], row["pair"]


def share(rows):
    """Recall, percent."""
    return 100 * sum(row["success"] for row in rows) / len(rows) if rows else float("nan")


def recall_line(who, voxel_m, rows, common):
    good = [row for row in rows if row["success"]]
    metres, degrees = [row["translation_m"] for row in good], [row["rotation_deg"] for row in good]
    shared = [row for row in good if identity(row) in common]
    shared = median(row["translation_m"] for row in shared), median(row["rotation_deg"] for row in shared)
    shared = f"{100 * shared[0]:.1f} cm, {shared[1]:.2f}°" if common and "+" in who else "–"
    mean = f"{100 * sum(metres) / len(good):.1f} cm, {sum(degrees) / len(good):.2f}°" if good else "–"
    middle = f"{100 * median(metres):.1f} cm, {median(degrees):.2f}°" if good else "–"
    return [who, voxel_m, f"{share(rows):.1f} %", mean, middle, shared, milliseconds(median(row["cpu_ms"] for row in rows))]


def scaling_table(result):
    """CPU ms by number of points, and the exponent p of growth nᵖ from the least to the most points."""
    from math import log

    rows = result["rows"]
    sizes = sorted({row["size"] for row in rows})
    lines = []
    for stage, who in dict.fromkeys((row["stage"], row["who"]) for row in rows):
        at = {row["size"]: row["cpu_ms"] for row in rows if (row["stage"], row["who"]) == (stage, who)}
        least, most = min(at), max(at)
        power = log(at[most] / at[least]) / log(most / least) if most > least else float("nan")
        costs = [milliseconds(at[size]) if size in at else "–" for size in sizes]
        lines.append([TITLES[stage], who, *costs, number(power, 2)])
    return table(["stage", "who", *(f"{size:,}" for size in sizes), "grows as nᵖ, p ="], lines)
