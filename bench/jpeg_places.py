"""What JPEG does to the places of markers at rest, read with OpenCV's decoder.

    cargo run --release -p slipbound-lab --example jpeg_places && python3 bench/jpeg_places.py

Compares the middle of the darkness of every dot in green before and after JPEG and ends with 1 when they differ by more
than 0.03 px in the mean. Needs the packages of bench/parity/requirements.txt.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

REACH_PX, MOST_BIAS_PX = 6, 0.03
folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/jpeg")


def centroids(green, places):
    """Middle of the darkness around each place: levels missing to the brightest sixth of 13 x 13 px."""
    out = np.empty((len(places), 2))
    for row, (x, y) in enumerate(np.rint(places).astype(int)):
        window = green[y - REACH_PX : y + REACH_PX + 1, x - REACH_PX : x + REACH_PX + 1].astype(float)
        ys, xs = np.mgrid[y - REACH_PX : y + REACH_PX + 1, x - REACH_PX : x + REACH_PX + 1]
        dark = np.maximum(np.sort(window.ravel())[window.size * 5 // 6] - window - 8, 0)
        out[row] = (dark * xs).sum() / dark.sum(), (dark * ys).sum() / dark.sum()
    return out


before, after = cv2.imread(str(folder / "rest.ppm")), cv2.imread(str(folder / "rest.jpg"))
places = np.loadtxt(folder / "markers.csv", delimiter=",", skiprows=1)
height, width = before.shape[:2]
inside = (places > REACH_PX + 2).all(1) & (places < np.array([width, height]) - REACH_PX - 3).all(1)
places = places[inside]
moved = centroids(after[..., 1], places) - centroids(before[..., 1], places)
bias = np.nanmean(moved, axis=0)
print(f"{len(places)} dots in green: JPEG moves them by {bias[0]:+.3f}, {bias[1]:+.3f} px in the mean")
sys.exit(0 if np.hypot(*bias) <= MOST_BIAS_PX else 1)
