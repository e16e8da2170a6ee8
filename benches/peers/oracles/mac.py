"""The graphs of MAC as dense matrices: what host/registration/src/mac/tests.rs expects of mac_correspondences.

usage: ECHOLOOP_DATA=... python mac.py     Prints, for each threshold of the published demonstration's score
1 - (d / 0.1 m)^2, the edges of the first-order graph, those in a triangle, and the sum of G = W o (W W) over edges.
"""
import os

import numpy as np

rows = np.loadtxt(os.path.join(os.environ["ECHOLOOP_DATA"], "mac_correspondences", "corr_data.txt"))


def distances(points):
    squared = sum((axis[:, None] - axis[None, :]) ** 2 for axis in points.T)
    return np.sqrt(squared)


stretch = np.abs(distances(rows[:, :3]) - distances(rows[:, 3:]))
for max_stretch in (0.1 * np.sqrt(1 - 0.999), 0.1 * np.sqrt(1 - 0.99)):
    w = np.where(stretch < max_stretch, 1 - (stretch / 0.1) ** 2, 0.0).astype(np.float32)
    np.fill_diagonal(w, 0)
    g = w * (w @ w)
    print(f"{max_stretch:.7f} {np.count_nonzero(w) // 2} {np.count_nonzero(g) // 2} {g.sum(dtype=np.float64) / 2:.6e}")
