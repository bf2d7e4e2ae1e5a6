"""Compares every pixel kernel of slipbound with OpenCV, on real and on drawn frames.

Run from anywhere:  python bench/parity/parity.py            # the checks, and a table of the default's markers
                    python bench/parity/parity.py --write    # and puts that table into README.md
Real frames come from the folder SLIPBOUND_DATA, or ../shared/data beside the project; without them only the drawn
frames are judged, and a line says so. The environment variable SLIPBOUND_PARITY names a built example to use instead
of `cargo run`. Exit code 1 when a kernel fails.
"""

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np

PROJECT = Path(__file__).resolve().parents[2]
# The rectification of one published GelSlim finger: camera image (flipped) to gel plane.
GELSLIM = np.array([
    [0.79809213, -0.33790120, 41.21788310],
    [0.03669927, 0.84359564, -24.59355941],
    [-0.00010275817, -0.00143881538, 1.0],
])

REAL_COUNT = 12
# Pitch and diameter of the markers as these pictures show them, px: what the sensor files say.
FINGERS = {
    "gelsight-lift": (60, 15),
    "gelslim3-press": (22, 7.9),
    "gelsight-mini-press": (30.8, 11),
    "gelsight-mini-wriggle": (44, 20),
}


class Kernels:
    """The example binary, one request at a time."""

    def __init__(self):
        built = os.environ.get("SLIPBOUND_PARITY")
        command = [built] if built else ["cargo", "run", "--quiet", "--release", "-p", "slipbound", "--example", "parity"]
        self.process = subprocess.Popen(command, cwd=PROJECT, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def request(self, kernel, numbers, *pictures):
        height, width = pictures[0].shape[:2]
        line = " ".join([kernel, str(width), str(height), *(repr(float(n)) for n in numbers)])
        self.process.stdin.write(line.encode() + b"\n" + b"".join(np.ascontiguousarray(p).tobytes() for p in pictures))
        self.process.stdin.flush()

    def read(self, count, dtype):
        size = count * np.dtype(dtype).itemsize
        data = self.process.stdout.read(size)
        if len(data) != size:
            sys.exit("the example ended early: see its message above")
        return np.frombuffer(data, dtype)

    def markers(self, paper, finger, grey):
        """Every marker at rest (x, y) and in the frame judged (x, y)."""
        self.request("markers", [paper, *finger], grey)
        count = int(self.read(1, "<f8")[0])
        return self.read(4 * count, "<f8").reshape(count, 4)

    def picture(self, kernel, numbers, *pictures, dtype=np.uint8, shape=None):
        self.request(kernel, numbers, *pictures)
        shape = shape or pictures[0].shape[:2]
        return self.read(shape[0] * shape[1], dtype).reshape(shape)

    def components(self, mask):
        self.request("components", [], mask)
        count = int(self.read(1, "<f8")[0])
        return self.read(7 * count, "<f8").reshape(count, 7)


class Results:
    """The worst difference of each kernel over all frames."""

    def __init__(self):
        self.rows = {}

    def add(self, kernel, allowed, unit, difference):
        row = self.rows.setdefault(kernel, {"allowed": allowed, "unit": unit, "frames": 0, "worst": 0.0})
        row["frames"] += 1
        row["worst"] = max(row["worst"], float(difference))

    def levels(self, kernel, got, expected, allowed=1.0):
        self.add(kernel, allowed, "levels", np.abs(got.astype(np.float64) - expected.astype(np.float64)).max())

    def pixels(self, kernel, got, expected):
        self.add(kernel, 0, "pixels", np.count_nonzero(got != expected))

    def report(self):
        print(f"{'kernel':38} {'frames':>6}  {'worst':>9} {'allowed':>8} unit    verdict")
        failed = 0
        for kernel, row in self.rows.items():
            good = row["worst"] <= row["allowed"]
            failed += not good
            print(f"{kernel:38} {row['frames']:6}  {row['worst']:9.4g} {row['allowed']:8.4g} {row['unit']:7} "
                  f"{'pass' if good else 'FAIL'}")
        print(f"{len(self.rows) - failed} passed, {failed} failed")
        return failed


def real_frames():
    """12 frames as (name, BGR, None), spread over the folders of the data."""
    named = os.environ.get("SLIPBOUND_DATA")
    folder = Path(named) if named else PROJECT.parent / "shared" / "data"
    if not folder.is_dir():
        print("real frames: SKIPPED, no SLIPBOUND_DATA and no ../shared/data")
        return []
    frames = []
    for kind, count in [("gelsight-lift", 5), ("gelslim3-press", 3)]:
        files = sorted((folder / kind).rglob("*.jpg"))
        for file in files[:: max(1, len(files) // count)][:count]:
            frames.append((kind, cv2.imread(str(file))))
    for kind, count in [("gelsight-mini-press", 2), ("gelsight-mini-wriggle", 2)]:
        files = sorted((folder / kind).rglob("*.avi"))
        for i in range(count if files else 0):
            video = cv2.VideoCapture(str(files[i * (len(files) - 1) // max(1, count - 1)]))
            for _ in range(60 + 40 * i):
                frame = video.read()[1]
            frames.append((kind, frame))
    frames = [(name, frame, None) for name, frame in frames if frame is not None]
    print(f"real frames: {len(frames)}")
    if len(frames) != REAL_COUNT:
        sys.exit(f"{folder}: expected {REAL_COUNT} frames, got {len(frames)}")
    return frames


def drawn_frames():
    """Five frames as (name, BGR, centres of the dots): dots on uneven light, with noise, texture and odd sizes."""
    random = np.random.default_rng(20190501)
    frames = []
    for width, height, pitch in [(640, 480, 30), (327, 320, 15), (427, 320, 19), (101, 67, 11), (64, 129, 13)]:
        y, x = np.mgrid[:height, :width].astype(np.float64)
        light = 120 + 60 * np.sin(x / width * 2.1) - 40 * (y / height) ** 2
        dots, centres = np.zeros((height, width)), []
        for cy in np.arange(pitch / 2, height, pitch):
            for cx in np.arange(pitch / 2, width, pitch):
                dx, dy = random.normal(0, 1.0, 2)
                centres.append((cx + dx, cy + dy))
                dots += 35 * (1 - np.tanh(np.hypot(x - cx - dx, y - cy - dy) - pitch / 5))
        inside = np.hypot((x - width / 2) / width, (y - height / 2) / height) < 0.3
        weave = np.where(inside, 25 * np.sign(np.sin(x * 1.1) * np.sin(y * 0.9)), 0)
        planes = [light * tint - dots + weave + random.normal(0, 4, light.shape) for tint in (0.8, 1.0, 1.15)]
        frame = np.clip(np.stack(planes, axis=2), 0, 255).astype(np.uint8)
        if width == 101:
            frame[10:30, 20:60] = random.integers(0, 256, (20, 40, 3), dtype=np.uint8)
        name = f"drawn {width}x{height}"
        FINGERS[name] = (pitch, 0.4 * pitch)
        frames.append((name, frame, np.array(centres)))
    return frames


def judge_grey(kernels, results, bgr):
    rgb = bgr[:, :, ::-1]
    for number, weights in enumerate([(0, 0.5, 0.5), (0.3, 0.7, 0), (0.299, 0.587, 0.114)]):
        flip = [None, 0, 1][number]
        expected = cv2.transform(rgb, np.array([weights], np.float32)).reshape(rgb.shape[:2])
        if flip is not None:
            expected = cv2.flip(expected, flip)
        results.levels("grey", kernels.picture("grey", [*weights, number], rgb), expected)


def bilinear(src, points):
    """Bilinear samples in float64, and whether their four pixels lie inside."""
    height, width = src.shape
    x, y = points
    inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    left = np.clip(np.floor(x), 0, width - 2).astype(int)
    top = np.clip(np.floor(y), 0, height - 2).astype(int)
    fx, fy = x - left, y - top
    at = lambda dx, dy: src[top + dy, left + dx].astype(np.float64)
    above = at(0, 0) * (1 - fx) + at(1, 0) * fx
    return (above * (1 - fy) + (at(0, 1) * (1 - fx) + at(1, 1) * fx) * fy), inside


def judge_warp(kernels, results, grey):
    height, width = grey.shape
    scale = np.diag([width / 427, height / 320, 1.0])
    forward = scale @ GELSLIM @ np.linalg.inv(scale)
    crop = np.array([[1, 0, width * 50 // 427], [0, 1, 0], [0, 0, 1.0]])
    back = np.linalg.inv(forward) @ crop
    shape = (height, width - 2 * (width * 50 // 427))
    got = kernels.picture("warp", [shape[1], shape[0], *back.flatten()], grey, shape=shape)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
    w = back[2, 0] * x + back[2, 1] * y + back[2, 2]
    points = [(back[k, 0] * x + back[k, 1] * y + back[k, 2]) / w for k in (0, 1)]
    exact, inside = bilinear(grey, points)
    # A table of 1/128 px misses by up to 1/256 px each way: 1 level on a step of 255; rounding adds half a level.
    results.levels("warp", got[inside], exact[inside], 1.5)
    results.add("warp, mean", 0.3, "levels", np.abs(got[inside] - exact[inside]).mean())
    cv = cv2.warpPerspective(grey, back, shape[::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    error = np.abs(cv[inside].astype(np.float64) - exact[inside])
    judge_warp.cv2_worst = max(getattr(judge_warp, "cv2_worst", 0), error.max())
    judge_warp.cv2_mean = max(getattr(judge_warp, "cv2_mean", 0), error.mean())
    # Within half a step of the border either answer is right.
    clear = (points[0] < -0.01) | (points[1] < -0.01) | (points[0] > width - 0.99) | (points[1] > height - 0.99)
    results.add("warp, outside", 0, "pixels", np.count_nonzero(got[clear]))


def judge_smooth(kernels, results, grey):
    for side, sigma in [((5, 5), 1.1), ((31, 31), 31), ((25, 15), 21), ((91, 91), 15)]:
        name = f"gaussian {side[0]}x{side[1]} sigma {sigma}"
        results.levels(name, kernels.picture("gaussian", [*side, sigma], grey), cv2.GaussianBlur(grey, side, sigma))
        got = kernels.picture("gaussian_f32", [*side, sigma], grey, dtype="<f4")
        results.levels(name + ", f32", got, cv2.GaussianBlur(grey.astype(np.float32), side, sigma), 0.01)
    for sigma in (10, 15, 30, 60):
        side = 2 * (4 * sigma) + 1
        exact = cv2.GaussianBlur(grey.astype(np.float64), (side, side), sigma)
        got = kernels.picture("background", [sigma], grey)
        name = f"background sigma {sigma}"
        results.levels(name, got, exact, 4.0)
        results.add(name + ", mean", 1.25, "levels", np.abs(got - exact).mean())
    for offset, gain, bias in [(50, 2, 20), (90, 1.1, 20)]:
        blurred = cv2.GaussianBlur(grey.astype(np.float32), (31, 31), 31)
        expected = np.clip(np.rint((grey - blurred + offset) * gain + bias), 0, 255)
        got = kernels.picture("flatten_gaussian", [31, 31, 31, offset, gain, bias], grey)
        results.levels("gaussian 31x31, flatten", got, expected)
        whole = np.rint(blurred).astype(np.uint8)
        expected = np.clip(np.rint((grey.astype(np.float64) - whole + offset) * gain + bias), 0, 255)
        results.levels("flatten", kernels.picture("flatten", [offset, gain, bias], grey, whole), expected)


def judge_edges(kernels, results, grey):
    height = grey.shape[0]
    blurred = cv2.GaussianBlur(grey.astype(np.float32), (31, 31), 31)
    flat = np.clip((grey - blurred + 50) * 2 + 20, 0, 255).astype(np.uint8)
    for src in (flat, grey):
        for low, high in [(90, 120), (50, 70), (20, 300), (0, 0), (2000, 2100)]:
            got = kernels.picture("canny", [0, height, low, high], src)
            results.pixels("canny", got, cv2.Canny(src, low, high))
    split = height * 284 // 320
    upper = kernels.picture("canny", [0, split, 90, 120], flat)
    lower = kernels.picture("canny", [split, height, 50, 70], flat)
    expected = np.vstack([cv2.Canny(flat[:split], 90, 120), cv2.Canny(flat[split:], 50, 70)])
    results.pixels("canny, upper and lower band", upper | lower, expected)
    return expected, flat


def judge_masks(kernels, results, edges, flat):
    names = {
        "dilate": lambda m, k: cv2.dilate(m, k),
        "erode": lambda m, k: cv2.erode(m, k),
        "close": lambda m, k: cv2.morphologyEx(m, cv2.MORPH_CLOSE, k),
        "open": lambda m, k: cv2.morphologyEx(m, cv2.MORPH_OPEN, k),
    }
    closed = cv2.morphologyEx(edges, cv2.MORPH_CLOSE, np.ones((6, 6), np.uint8))
    dark = np.where(flat < 100, 255, 0).astype(np.uint8)
    sides = [(1, 1), (2, 2), (3, 3), (5, 5), (6, 6), (11, 11), (4, 9), (7, 2)]
    round_sides = [(4, 4), (5, 5), (15, 15), (24, 10), (25, 25), (45, 45), (1, 7), (150, 31)]
    for operation, of_cv2 in names.items():
        for mask in (edges, closed, dark):
            for shape, round_, all_sides in [("rect", 0, sides), ("ellipse", 1, round_sides)]:
                for side in all_sides:
                    element = cv2.getStructuringElement(cv2.MORPH_ELLIPSE if round_ else cv2.MORPH_RECT, side)
                    got = kernels.picture(operation, [round_, *side], mask)
                    results.pixels(f"{operation}, {shape}", got, of_cv2(mask, element))
    for mask in (edges, dark):
        judge_components(kernels, results, mask)
    levels = cv2.GaussianBlur(flat, (31, 31), 31)
    for level in (0, 60, 90, 255):
        expected = np.where(flat < level, 255, 0)
        results.pixels("threshold", kernels.picture("below_level", [level], flat), expected)
    got = kernels.picture("below_levels", [], flat, levels)
    results.pixels("threshold, level image", got, np.where(flat < levels, 255, 0))


def judge_components(kernels, results, mask):
    _, labels, stats, centroids = cv2.connectedComponentsWithStats(mask, connectivity=8)
    left, top, width, height, area = stats[1:].T
    expected = np.column_stack([area, left, top, left + width, top + height, centroids[1:]])
    got = kernels.components(mask)
    order = lambda rows: rows[np.lexsort(rows.T)]
    worst = np.inf if got.shape != expected.shape else np.abs(order(got) - order(expected)).max(initial=0)
    results.add("components", 1e-9, "px", worst)
    small = np.isin(labels, 1 + np.flatnonzero(area < 20)) | (labels == 0)
    got = kernels.picture("remove_small", [20], mask)
    results.pixels("components, small removed", got, np.where(small, 0, mask))
    # cv2 fills from outside: what it cannot reach, 4 ways, is a hole.
    outside = cv2.copyMakeBorder(mask, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    cv2.floodFill(outside, None, (0, 0), 255, flags=4)
    filled = mask | ~outside[1:-1, 1:-1]
    results.pixels("components, holes filled", kernels.picture("fill_holes", [], mask), filled)


def paper_mask(kernels, grey, pitch_px):
    """The marker mask of the paper's settings in cv2, from our flat picture: local thresholds, close, dilate."""
    # Lengths of the released code are px at a pitch of 15.2 px.
    of_pitch = lambda px: max(1, int(px / 15.2 * pitch_px + 0.5))
    side = 31 if pitch_px == 15.2 else int((31 / 15.2 * pitch_px - 1) / 2 + 0.5) * 2 + 1
    flat = kernels.picture("flatten_gaussian", [side, side, 31 / 15.2 * pitch_px, 50, 2, 20], grey)
    around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (of_pitch(45), of_pitch(45)))
    levels = np.full_like(flat, 90)
    for below, level in [(70, 80), (40, 50), (10, 20)]:
        dark = np.where(flat < below, 255, 0).astype(np.uint8)
        levels[cv2.morphologyEx(dark, cv2.MORPH_CLOSE, around) > 0] = level
    mask = np.where(flat < levels, 255, 0).astype(np.uint8)
    rect = lambda px: np.ones((of_pitch(px), of_pitch(px)), np.uint8)
    return cv2.dilate(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, rect(2)), rect(5)), round(9 * (pitch_px / 15.2) ** 2)


def judge_markers(kernels, results, name, grey):
    """The paper's markers against the blobs of the same mask in cv2; returns how far the default's are from those."""
    pitch, diameter = FINGERS[name]
    mask, least_area = paper_mask(kernels, grey, pitch)
    _, _, stats, centroids = cv2.connectedComponentsWithStats(mask, connectivity=8)
    blobs = centroids[1:][stats[1:, cv2.CC_STAT_AREA] >= least_area]
    height, width = grey.shape
    margin = diameter / 2 + 0.5
    whole = blobs[((blobs >= margin) & (blobs <= [width - 1 - margin, height - 1 - margin])).all(axis=1)]
    apart = lambda a, b: np.linalg.norm(a[:, None] - b[None], axis=2)
    paper = kernels.markers(1, (pitch, diameter), grey)
    unknown = apart(paper[:, :2], whole)
    results.add("paper's markers at rest", 0.1, "px", unknown.min(axis=1).max())
    results.add("blobs without a marker", 0, "blobs", np.count_nonzero(unknown.min(axis=0) > 0.1))
    results.add("paper's markers in a frame", 0.1, "px", apart(paper[:, 2:], blobs).min(axis=1).max())
    default = kernels.markers(0, (pitch, diameter), grey)[:, :2]
    nearest = apart(default, whole)
    # A blob within a third of a pitch is the same dot.
    same = nearest.min(axis=1) < pitch / 3
    return len(blobs), default[same], whole[nearest.argmin(axis=1)][same], int(np.count_nonzero(~same))


def spread(apart):
    """Median, 95 % and most of the lengths, px."""
    lengths = np.linalg.norm(apart, axis=1)
    return f"{np.median(lengths):.2f} / {np.percentile(lengths, 95):.2f} / {lengths.max():.2f}"


def table_row(name, truth, blobs_count, default, blobs, alone_count):
    """How far the markers of the default settings are from the paper's blobs; on a drawn frame, from the truth too."""
    apart = default - blobs
    shift = np.median(apart, axis=0)
    row = [name, blobs_count, len(default), alone_count, "{:+.1f}, {:+.1f}".format(*shift + 0.0)]
    row += [spread(apart), spread(apart - shift)]
    if truth is None:
        return row + ["-", "-"]
    centred = truth[np.linalg.norm(default[:, None] - truth[None], axis=2).argmin(axis=1)]
    off = blobs - centred
    return row + [spread(default - centred), spread(off - np.median(off, axis=0))]


TABLE_TITLE = "## Markers of the default settings against the paper's blobs"
TABLE_HEAD = """
Default minus blob, px; `median / 95 % / most`. Same dot: within a third of a pitch of each other; alone: a marker of
the default without such a blob. Written by `python bench/parity/parity.py --write`.

| frame | blobs | same dot | alone | shift x, y | apart | less the shift | default from truth | blob from truth, less the shift |
|---|---|---|---|---|---|---|---|---|
"""


def table(rows):
    return TABLE_HEAD + "".join("| " + " | ".join(str(cell) for cell in row) + " |\n" for row in rows)


def write_table(rows):
    """Puts the table at the end of the README beside this file."""
    readme = Path(__file__).with_name("README.md")
    text = readme.read_text()
    readme.write_text(text[: text.index(TABLE_TITLE)] + TABLE_TITLE + "\n" + table(rows))


def least_squares(before, after):
    """Rigid motion by singular values (Kabsch), in float64: mean displacement and angle."""
    a, b = before - before.mean(0), after - after.mean(0)
    u, _, vt = np.linalg.svd(a.T @ b)
    turn = vt.T @ np.diag([1, np.linalg.det(vt.T @ u.T)]) @ u.T
    return np.array([*(after.mean(0) - before.mean(0)), np.arctan2(turn[1, 0], turn[0, 0])])


def similarity(before, after):
    """Least-squares similarity as linear equations, and its angle as the paper reads it: arcsin of the lower left entry."""
    zero, one = np.zeros(len(before)), np.ones(len(before))
    x, y = before.T
    rows = np.vstack([np.stack([x, -y, one, zero], 1), np.stack([y, x, zero, one], 1)])
    found = np.linalg.lstsq(rows, after.T.reshape(-1), rcond=None)[0]
    return np.array([*(after.mean(0) - before.mean(0)), np.arcsin(np.clip(found[1], -1, 1))]), found


def judge_rigid(kernels, results):
    """The fits of step 3 on seeded point sets."""
    random = np.random.default_rng(7)
    dot = np.zeros((1, 1), np.uint8)
    for i in range(50):
        count, angle = int(random.integers(4, 120)), random.uniform(-0.5, 0.5)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        before = random.uniform(0, 300, (count, 2))
        exact = before @ turn.T + random.uniform(-20, 20, 2)
        after = exact + random.normal(0, 0.3, before.shape)

        def ours(variant, after):
            kernels.request("rigid_fit", [variant, 20, *np.hstack([before, after]).ravel()], dot)
            return kernels.read(3, "<f8")
        results.add("rigid fit against SVD", 1e-4, "px, rad", np.abs(ours(0, after) - least_squares(before, after)).max())
        expected, found = similarity(before, after)
        results.add("similarity fit against numpy", 1e-4, "px, rad", np.abs(ours(1, after) - expected).max())
        if count >= 20:
            # cv2 without its outlier search: every point an inlier, refined by least squares.
            cv = cv2.estimateAffinePartial2D(before, after, ransacReprojThreshold=1e6, refineIters=100)[0]
            results.add("similarity: numpy against cv2", 1e-3, "px", np.abs(cv[1, 0] - found[1]) * 300)
        # The robust fit is least squares where all agree, and keeps the motion of most where a third does not.
        results.add("robust fit, exact points", 1e-4, "px, rad", np.abs(ours(2, exact) - least_squares(before, exact)).max())


def main():
    cv2.setNumThreads(1)
    frames = real_frames() + drawn_frames()
    kernels, results, rows = Kernels(), Results(), []
    for name, bgr, truth in frames:
        grey = cv2.transform(bgr, np.array([[0.5, 0.5, 0]], np.float32)).reshape(bgr.shape[:2])
        judge_grey(kernels, results, bgr)
        judge_warp(kernels, results, grey)
        judge_smooth(kernels, results, grey)
        edges, flat = judge_edges(kernels, results, grey)
        judge_masks(kernels, results, edges, flat)
        rows.append(table_row(name, truth, *judge_markers(kernels, results, name, grey)))
    judge_rigid(kernels, results)
    print(table(rows))
    if "--write" in sys.argv[1:]:
        write_table(rows)
    print(f"cv2 {cv2.__version__} on {len(frames)} frames; for comparison, cv2.warpPerspective against float64 sampling: "
          f"worst {judge_warp.cv2_worst:.3g}, mean {judge_warp.cv2_mean:.3g} levels")
    sys.exit(1 if results.report() else 0)


if __name__ == "__main__":
    main()
