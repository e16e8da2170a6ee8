"""Register two scans of yours and draw them, seen from above, before and after.

python register_two_scans.py target.ply source.ply --plot scans.png
"""

import argparse
from pathlib import Path

import echoloop
import numpy as np


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target", type=Path)
    parser.add_argument("source", type=Path)
    parser.add_argument("--plot", type=Path, help="picture to write (needs matplotlib)")
    args = parser.parse_args()

    target, source = echoloop.read_cloud(args.target), echoloop.read_cloud(args.source)
    found = echoloop.register(target, source)
    print(found)
    print(np.array2string(found.target_from_source, precision=4, suppress_small=True))
    if found and found.covariance is not None:
        deviations = np.sqrt(np.diag(found.covariance))
        print("standard deviations, mrad:", np.round(1e3 * deviations[:3], 3))
        print("and mm:", np.round(1e3 * deviations[3:], 2))
    if args.plot:
        plot(args.plot, target, source, source.transformed(found.target_from_source))


def plot(path: Path, target: echoloop.Cloud, *sources: echoloop.Cloud) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, 2, figsize=(12, 6), sharex=True, sharey=True)
    for panel, source, title in zip(panels, sources, ["as given", "registered"], strict=True):
        for cloud, name in [(target, "target"), (source, "source")]:
            panel.scatter(cloud.points[:, 0], cloud.points[:, 1], s=0.2, label=name)
        panel.set(title=title, xlabel="x, m", ylabel="y, m", aspect="equal")
    panels[0].legend(markerscale=10)
    figure.savefig(path, dpi=120)
    print("wrote", path)


if __name__ == "__main__":
    main()
