"""The same work in OpenCV, measured beside ours in one run: milliseconds and ratios.

`python3 bench/opencv_baseline.py` times a fixed list of OpenCV calls (one thread, 640x480 colour frame with a contact and
some 400 markers of 5 px; median of 300 after 20, calls only), one memcpy of the frame, and our own step bench
(`cargo bench -p slipbound --bench step`), and prints two tables; with `--write` they go into bench/README.md. Further
arguments are criterion's (`--quick`). Needs numpy and opencv-python-headless, and a machine that does nothing else.
"""

import os
import re
import statistics
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np

WARM_UP_COUNT, RUNS_COUNT = 20, 300
WIDTH_PX, HEIGHT_PX, PITCH_PX, RADIUS_PX = 640, 480, 26.5, 2.5


def painted_frame():
    """A lit gel with a grid of dark dots and a pressed weave in the middle, as the step bench paints it."""
    rng = np.random.default_rng(9)
    y, x = np.mgrid[:HEIGHT_PX, :WIDTH_PX].astype(np.float32)
    light = np.stack([150 - 40 * x / WIDTH_PX, 120 + 30 * y / HEIGHT_PX, 130 + 30 * x / WIDTH_PX], -1)
    inside = ((x - 320) / 210) ** 2 + ((y - 240) / 180) ** 2 < 1
    weave = 32 * np.sin(x * 2 * np.pi / 10) * np.sin(y * 2 * np.pi / 10) * inside
    light += weave[..., None]
    for row in np.arange(PITCH_PX, HEIGHT_PX - 10, PITCH_PX):
        for column in np.arange(PITCH_PX, WIDTH_PX - 10, PITCH_PX):
            light[(x - column) ** 2 + (y - row) ** 2 < RADIUS_PX**2] -= 60
    light += rng.normal(0, 3, (HEIGHT_PX, WIDTH_PX, 1))
    return np.clip(light, 0, 255).astype(np.uint8)


def timed(call, clock=time.perf_counter, runs_count=RUNS_COUNT, warm_up_count=WARM_UP_COUNT):
    """Median milliseconds of a call, and what it returned."""
    times = []
    for i in range(warm_up_count + runs_count):
        start = clock()
        result = call()
        if i >= warm_up_count:
            times.append(clock() - start)
    return 1e3 * statistics.median(times), result


def opencv_steps(frame, clock=time.perf_counter, runs_count=RUNS_COUNT, warm_up_count=WARM_UP_COUNT):
    """The fixed list of calls, each with its step of the method."""
    cv2.setNumThreads(1)
    steps = []

    def step(of, name, call):
        milliseconds, result = timed(call, clock, runs_count, warm_up_count)
        steps.append((of, name, milliseconds))
        return result

    turn = np.array([[1, 0.02, -5], [-0.02, 1, 6], [0, 0, 1]], np.float64)
    warped = step("imprint", "warpPerspective", lambda: cv2.warpPerspective(frame, turn, (WIDTH_PX, HEIGHT_PX)))
    warped = np.ascontiguousarray(warped[:, 75:-75])
    weights = np.array([[0.5, 0.5, 0]], np.float32)
    grey = step("imprint", "grey (transform)", lambda: cv2.transform(warped, weights))
    as_float = step("imprint", "to f32", lambda: grey.astype(np.float32))
    blurred = step("imprint", "GaussianBlur f32 31x31", lambda: cv2.GaussianBlur(as_float, (31, 31), 31))
    flat = step(
        "imprint",
        "flatten",
        lambda: cv2.convertScaleAbs(cv2.max(cv2.subtract(as_float, blurred), -60), alpha=2, beta=120),
    )
    cut = flat.shape[0] * 2 // 3
    upper = step("contact", "Canny 90/120, upper two thirds", lambda: cv2.Canny(flat[:cut], 90, 120))
    lower = step("contact", "Canny 50/70, lower third", lambda: cv2.Canny(flat[cut:], 50, 70))
    edges = np.vstack([upper, lower])
    square = lambda side: cv2.getStructuringElement(cv2.MORPH_RECT, (side, side))
    ellipse = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (25, 25))
    closed = step("contact", "close square 6", lambda: cv2.morphologyEx(edges, cv2.MORPH_CLOSE, square(6)))
    eroded = step("contact", "erode square 11", lambda: cv2.erode(closed, square(11)))
    contact = step("contact", "dilate ellipse 25", lambda: cv2.dilate(eroded, ellipse))
    step("motion", "erode ellipse 25 (inner region)", lambda: cv2.erode(contact, ellipse))
    levels = np.full_like(flat, 90)
    mask = step("markers", "threshold", lambda: cv2.compare(flat, levels, cv2.CMP_LT))
    mask = step(
        "markers",
        "marker mask: dilate 2, erode 2, dilate 5",
        lambda: cv2.dilate(cv2.erode(cv2.dilate(mask, square(2)), square(2)), square(5)),
    )
    settings = cv2.SimpleBlobDetector_Params()
    settings.minThreshold, settings.maxThreshold, settings.thresholdStep = 1, 12, 10
    settings.minRepeatability, settings.minDistBetweenBlobs = 2, 9
    settings.filterByArea, settings.minArea = True, 9
    settings.filterByColor = settings.filterByCircularity = settings.filterByConvexity = False
    settings.filterByInertia = False
    detector = cv2.SimpleBlobDetector_create(settings)
    step("markers", "SimpleBlobDetector", lambda: detector.detect(mask))
    rng = np.random.default_rng(1)
    before = rng.uniform(100, 400, (60, 2)).astype(np.float32)
    after = before + rng.normal(0, 0.1, (60, 2)).astype(np.float32) + np.float32([2, 1])
    step("motion", "estimateAffinePartial2D, 60 matches", lambda: cv2.estimateAffinePartial2D(before, after))
    return steps


def our_steps(root):
    """Medians of our own bench, by finger and step, in milliseconds."""
    further = [argument for argument in sys.argv[1:] if argument != "--write"]
    command = ["cargo", "bench", "-p", "slipbound", "--bench", "step", "--", *further]
    run = subprocess.run(command, cwd=root, stdout=subprocess.PIPE, text=True, check=True)
    unit = {"ns": 1e-6, "µs": 1e-3, "ms": 1.0}
    found, name = {}, None
    for line in run.stdout.splitlines():
        named = re.match(r"(\S.*), \d+ markers/(\w+)", line)
        name = named.groups() if named else name
        times = re.search(r"time:\s+\[\S+ \S+ (\S+) (\S+) ", line)
        if times and name:
            found[name] = float(times[1]) * unit[times[2]]
    return found


TITLE = "## Beside OpenCV"
STEPS = ["imprint", "contact", "markers", "motion", "slip", "whole"]


def tables(memcpy, calls, ours):
    """The calls one by one, then our steps against the calls that do the same."""
    of_cv2 = {step: sum(ms for of, _, ms in calls if of == step) for step in STEPS}
    of_cv2["whole"] = sum(ms for _, _, ms in calls)
    lines = [
        "",
        f"`python3 bench/opencv_baseline.py --write`: cv2 {cv2.__version__}, one thread, 640x480, some 400 markers of 5 px;",
        "median of 300 after 20, calls only. In the same run our step bench, medians. One memcpy of the frame (0.9 MB) took "
        f"{memcpy:.3f} ms; load of the machine {os.getloadavg()[0]:.1f}.",
        "OpenCV's list leaves matching and the slip field out; ours has them.",
        "",
        "| step | call of cv2 | ms | memcpys |",
        "|---|---|---|---|",
    ]
    lines += [f"| {of} | {name} | {ms:.3f} | {ms / memcpy:.1f} |" for of, name, ms in calls]
    lines += [f"| whole | all of them | {of_cv2['whole']:.2f} | {of_cv2['whole'] / memcpy:.0f} |", ""]
    lines += ["| finger | step | cv2 | ours | cv2 / ours | ours, memcpys |", "|---|---|---|---|---|---|"]
    for (finger, step), ms in ours.items():
        theirs = of_cv2.get(step, 0)
        ratio = f"{theirs / ms:.1f}" if theirs else "-"
        theirs = f"{theirs:.2f} ms" if theirs else "-"
        lines.append(f"| {finger} | {step} | {theirs} | {ms:.3f} ms | {ratio} | {ms / memcpy:.1f} |")
    return "\n".join(lines) + "\n"


def write(root, text):
    """Puts the tables into bench/README.md, before its next heading."""
    readme = root / "bench" / "README.md"
    before, rest = readme.read_text().split(TITLE + "\n", 1)
    after = rest[rest.index("\n## ") :]
    readme.write_text(before + TITLE + "\n" + text + after)


def main():
    root = Path(__file__).resolve().parent.parent
    # Ours first: it may have to be built.
    ours = our_steps(root)
    frame = painted_frame()
    target = np.empty_like(frame)
    memcpy, _ = timed(lambda: np.copyto(target, frame))
    text = tables(memcpy, opencv_steps(frame), ours)
    print(text)
    if "--write" in sys.argv[1:]:
        write(root, text)


if __name__ == "__main__":
    main()
