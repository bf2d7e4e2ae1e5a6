"""Numbers of pictures of a finger at rest, measured alike on real and on simulated ones.

    python3 bench/real/picture_numbers.py PICTURE [PICTURE of the same finger ...] [--scale 0.667]

The first picture gives all but the noise, the standard deviation of a pixel's green from picture to picture, in the mean over the
middle: nothing may touch the finger, and its light must stay. `--scale` shrinks pictures first, lengths with
them. Dots are what is darker in green than 0.75 of its surroundings. The middle is that half of width and height. Needs the
packages of bench/real/requirements.txt.
"""

import argparse

import cv2
import numpy as np


def blurred(levels, sigma_px, weight=None):
    """Gaussian, by a weight where there is one."""
    if weight is None:
        return cv2.GaussianBlur(levels, (0, 0), sigma_px)
    return cv2.GaussianBlur(levels * weight, (0, 0), sigma_px) / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma_px), 1e-6)


def load(path, scale):
    picture = cv2.imread(path, cv2.IMREAD_COLOR)
    if picture is None:
        raise SystemExit(f"{path}: no picture")
    if scale != 1:
        picture = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return picture.astype(np.float32)


parser = argparse.ArgumentParser()
parser.add_argument("pictures", nargs="+")
parser.add_argument("--scale", type=float, default=1)
words = parser.parse_args()
pictures = [load(path, words.scale) for path in words.pictures]
first = pictures[0]
green = first[..., 1]
height, width = green.shape
middle = (slice(height // 4, 3 * height // 4), slice(width // 4, 3 * width // 4))
print(f"{words.pictures[0]}: {width} x {height} px")
print(f"below 30 in every colour: {100 * (first < 30).all(2).mean():.1f} % of pixels; median green {np.median(green):.0f}")

dark = (green < 0.75 * blurred(green, width / 45)).astype(np.uint8)
count, labels, stats, centres = cv2.connectedComponentsWithStats(dark)
inside = [
    i
    for i in range(1, count)
    if 8 <= stats[i, cv2.CC_STAT_AREA] <= 400
    and width // 4 < centres[i][0] < 3 * width // 4
    and height // 4 < centres[i][1] < 3 * height // 4
]
background = blurred(green, width / 45, 1 - cv2.dilate(dark, np.ones((5, 5))).astype(np.float32))
depth = [1 - (green[labels == i] / background[labels == i]).min() for i in inside]
diameter = [np.sqrt(4 * stats[i, cv2.CC_STAT_AREA] / np.pi) for i in inside]
if inside:
    print(f"dots in the middle: {len(inside)}, {np.median(diameter):.1f} px across, contrast {np.median(depth):.2f} of the light around")

beside = 1 - cv2.dilate(dark, np.ones((7, 7))).astype(np.float32)
clear = beside[middle] > 0
for fine_px, coarse_px in [(0, 2), (0.8, 6), (1, 6)]:
    fine = blurred(green, fine_px, beside) if fine_px else green
    coarse = blurred(green, coarse_px, beside)
    levels = (fine - coarse)[middle][clear]
    share = ((fine - coarse) / np.maximum(coarse, 1))[middle][clear]
    print(f"beside the dots, sigma {fine_px} to {coarse_px} px: {levels.std():.2f} levels, {100 * share.std():.2f} % of the light")
if len(pictures) > 1:
    all_green = np.stack([picture[..., 1][middle] for picture in pictures])
    print(f"noise of a pixel over {len(pictures)} pictures: {all_green.std(axis=0, ddof=1).mean():.2f} levels")
