"""Checks the markers that `slipbound watch` reports on real recordings against an independent tracker.

Run from anywhere:  python bench/real/check_tracking.py [lift] [press] [wriggle] [--keep FOLDER]
Recordings come from the folder SLIPBOUND_DATA, or ../shared/data beside the project; without them one line says so.
The independent tracker is OpenCV's: Lucas-Kanade of frame 0's templates, the guess carried from frame to frame, and
trusted only where it comes back to where it started and the template still looks the same. Where it is not sure it
declines to answer, and the tables say how often. README.md beside this file explains every column.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

PROJECT = Path(__file__).resolve().parents[2]


# ---- what we report

class Report:
    """The JSON lines of one recording."""

    def __init__(self, path, exit_code):
        lines = [json.loads(line) for line in path.read_text().splitlines()]
        self.exit_code = exit_code
        self.header, self.frames = lines[0], lines[1:]
        self.pitch_px = self.header["sensor"]["pitch_px"]
        self.radius_px = self.header["sensor"]["marker_diameter_px"] / 2
        field = np.array([frame["field"] for frame in self.frames], np.float64)
        self.places = field[:, :, 1:3]  # frame, marker, x and y
        self.shifts = field[:, :, 3:5]
        self.lost = np.array([np.isin(row[:, 0], frame["lost_ids"]) for row, frame in zip(field, self.frames)])
        self.lost_count = self.lost.sum(1)
        self.markers_count = field.shape[1]


def watch(binary, source, sensor, folder):
    """Runs the command on a recording: once to find the rest frame, and again with that one known from the first frame
    on, so that the same marker has the same row in every frame."""
    path = folder / ("_".join(source.with_suffix("").parts[-2:]) + ".jsonl")
    command = [binary, "watch", source, "--sensor", sensor, "--json", path, "--markers"]
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    first, end = json.loads(path.read_text().splitlines()[0])["rest"]["frames"]
    command += ["--rest", f"{first}..{end}"]
    run = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    if run.returncode != 0:
        print(f"{source.name}: exit code {run.returncode}: {run.stderr.strip()}")
    return Report(path, run.returncode)


def pictures(source):
    """The grey frames of an image folder or a video."""
    if source.is_dir():
        return [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in sorted(source.glob("*.jpg"))]
    video, frames = cv2.VideoCapture(str(source)), []
    while (frame := video.read()[1]) is not None:
        frames.append(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY))
    return frames


# ---- the independent tracker

def flow(before, after, points, side, guess=None, levels=3):
    """Lucas-Kanade: where the points of one frame are in another."""
    points = points.astype(np.float32).reshape(-1, 1, 2)
    window = {"winSize": (side, side), "maxLevel": levels, "criteria": (3, 30, 0.003)}
    if guess is not None:
        guess = guess.astype(np.float32).reshape(-1, 1, 2).copy()
        window["flags"] = cv2.OPTFLOW_USE_INITIAL_FLOW
    found, status, _ = cv2.calcOpticalFlowPyrLK(before, after, points, guess, **window)
    return np.where(status == 1, found[:, 0], np.nan).astype(np.float64)


def likeness(before, after, points, places, side):
    """Normalised cross-correlation of the patches around points of one frame and places in another."""
    scores = np.full(len(points), -1.0)
    for i in np.flatnonzero(np.isfinite(places).all(1)):
        a = cv2.getRectSubPix(before, (side, side), points[i].tolist())
        b = cv2.getRectSubPix(after, (side, side), places[i].tolist())
        scores[i] = cv2.matchTemplate(a, b, cv2.TM_CCOEFF_NORMED)[0, 0]
    return scores


def expected(points, places, known, markers):
    """Where the motion of the six nearest known markers puts others."""
    known = np.flatnonzero(known)
    away = np.linalg.norm(points[markers][:, None] - points[known][None], axis=2)
    near = known[np.argsort(away, axis=1, kind="stable")[:, :6]]
    return points[markers] + np.median(places[near] - points[near], axis=1)


def follow(frames, points, side, pitch_px):
    """Follows points of the first frame through all; (places, trusted), each with a row a frame.

    A step from frame to frame gives the guess, the template of the first frame the place. Trusted: the step and the
    template both lead back to within 0.3 px of their beginning, and the correlation with the template is above 0.8.
    A chain of steps once broken is taken up where the neighbours' motion leads, and trusted again when the template
    fits there, within a quarter of a pitch: too little for the next dot.
    """
    points = points.astype(np.float64)
    places = np.full((len(frames), len(points), 2), np.nan)
    trusted = np.zeros(places.shape[:2], bool)
    places[0], trusted[0] = points, True
    last, chained = points, np.ones(len(points), bool)
    for i in range(1, len(frames)):
        step = flow(frames[i - 1], frames[i], last, side)
        back = flow(frames[i], frames[i - 1], np.nan_to_num(step), side)
        chained &= np.linalg.norm(back - last, axis=1) < 0.3
        told = step.copy()
        if chained.any() and not chained.all():
            told[~chained] = expected(points, step, chained, np.flatnonzero(~chained))
        guess = np.where(np.isfinite(told), told, last)
        exact = flow(frames[0], frames[i], points, side, guess=guess, levels=0)
        home = flow(frames[i], frames[0], np.nan_to_num(exact), side, guess=points, levels=0)
        good = np.linalg.norm(home - points, axis=1) < 0.3
        good &= likeness(frames[0], frames[i], points, exact, side) > 0.8
        good &= np.linalg.norm(exact - guess, axis=1) < np.where(chained, 2.0, 0.25 * pitch_px)
        chained |= good
        last = np.where(good[:, None], exact, guess)
        places[i], trusted[i] = last, good
    return places, trusted


def dots(frame, radius_px, pitch_px):
    """Dark dots as rows (x, y, contrast in levels), strongest first: peaks of a difference of Gaussians."""
    grey = frame.astype(np.float32)
    contrast = cv2.GaussianBlur(grey, (0, 0), 1.8 * radius_px) - cv2.GaussianBlur(grey, (0, 0), 0.6 * radius_px)
    reach = 2 * int(0.4 * pitch_px) + 1
    peaks = (contrast == cv2.dilate(contrast, np.ones((reach, reach), np.uint8))) & (contrast > 0)
    y, x = np.nonzero(peaks)
    return np.column_stack([x, y, contrast[y, x]])[np.argsort(-contrast[y, x], kind="stable")]


def whole(places, shape, radius_px):
    """Whether dots at places lie in the frame with their whole width."""
    x, y = places[..., 0], places[..., 1]
    return (x > radius_px) & (y > radius_px) & (x < shape[1] - 1 - radius_px) & (y < shape[0] - 1 - radius_px)


def visible(frames, places, trusted, radius_px, pitch_px):
    """Where each marker can be seen whole, whatever our tracker says; NaN where it cannot.

    A trusted marker is where it is. For any other: a dot of at least 0.4 of the usual contrast in the first frame,
    within half a pitch of where its nearest trusted neighbours' motion puts it, and not one of the trusted markers.
    """
    seen = np.where(trusted[..., None], places, np.nan)
    typical = np.median(dots(frames[0], radius_px, pitch_px)[: len(places[0]), 2])
    for i in np.flatnonzero(~trusted.all(1) & trusted.any(1)):
        found = dots(frames[i], radius_px, pitch_px)
        found = found[found[:, 2] > 0.4 * typical, :2]
        apart = np.linalg.norm(found[:, None] - places[i][trusted[i]][None], axis=2)
        found = found[apart.min(1) > 0.25 * pitch_px]
        others = np.flatnonzero(~trusted[i]) if len(found) else np.array([], int)
        for marker, place in zip(others, expected(places[0], places[i], trusted[i], others)):
            off = np.linalg.norm(found - place, axis=1)
            if off.min() < 0.5 * pitch_px:
                seen[i, marker] = found[off.argmin()]
    seen[~whole(seen, frames[0].shape, radius_px)] = np.nan
    return seen


def longest_run(flags):
    """The longest run of True along the first axis."""
    longest, run = 0, np.zeros(flags.shape[1:], int)
    for row in flags:
        run = (run + 1) * row
        longest = max(longest, int(run.max(initial=0)))
    return longest


# ---- the three checks

class Results:
    """Figures against their bars."""

    def __init__(self):
        self.rows = []

    def add(self, figure, value, good, bar):
        self.rows.append((figure, value, good, bar))

    def report(self):
        print(f"\n{'figure':62} {'value':>12}  {'bar':>12}  verdict")
        for figure, value, good, bar in self.rows:
            print(f"{figure:62} {value:>12}  {bar:>12}  {'pass' if good else 'FAIL'}")
        failed = sum(not good for _, _, good, _ in self.rows)
        print(f"{len(self.rows) - failed} passed, {failed} failed")
        return failed


def percent(part, all_of):
    return 100.0 * part / max(1, all_of)


def check_lift(results, data, run):
    """Every clip from its frame 0, in which something touches already."""
    print(f"\n{'gelsight-lift':20} {'markers':>7} {'by dots':>8} {'missed':>6} {'matched%':>8} {'within1px%':>10} "
          f"{'median_px':>9} {'declined%':>9}")
    shares, agreed, trusted_count, all_count, dots_count, missed_count = [], 0, 0, 0, 0, 0
    clips = sorted(folder for folder in (data / "gelsight-lift").iterdir() if folder.is_dir())
    for clip in clips:
        report, frames = run(clip, "gelsight"), pictures(clip)
        found = dots(frames[0], report.radius_px, report.pitch_px)
        strong = found[:, 2] > 0.35 * np.median(found[:50, 2])
        found = found[strong & whole(found, frames[0].shape, report.radius_px + 1), :2]
        apart = np.linalg.norm(found[:, None] - report.places[0][None], axis=2)
        missed = found[apart.min(1) > 0.3 * report.pitch_px]
        # In the worst frame: what is lost at any time counts, whether it comes back or not.
        shares.append(100.0 - percent(report.lost_count.max(), report.markers_count))
        places, trusted = follow(frames, report.places[0], 31, report.pitch_px)
        off = np.linalg.norm(places - report.places, axis=2)[trusted]
        agreed, trusted_count = agreed + (off < 1).sum(), trusted_count + trusted.sum()
        all_count += trusted.size
        dots_count, missed_count = dots_count + len(found), missed_count + len(missed)
        print(f"{clip.name:20} {report.markers_count:7} {len(found):8} {len(missed):6} {shares[-1]:8.2f} "
              f"{percent((off < 1).sum(), off.size):10.2f} {np.median(off):9.3f} "
              f"{percent((~trusted).sum(), trusted.size):9.2f}"
              + "".join(f"  missed ({x:.0f}, {y:.0f})" for x, y in missed))
    print(f"dots of frame 0 that an independent detector sees whole: {dots_count}, of these not ours {missed_count}; "
          f"(marker, frame) pairs the independent tracker declined: {all_count - trusted_count} of {all_count}")
    mean, least, within = np.mean(shares), min(shares), percent(agreed, trusted_count)
    figure = f"lift: markers matched in the worst frame, mean of {len(clips)}"
    results.add(figure, f"{mean:.2f} %", mean >= 99.5, ">= 99.5 %")
    results.add("lift: the same, worst clip", f"{least:.2f} %", least >= 98, ">= 98 %")
    results.add("lift: within 1 px of the independent tracker", f"{within:.2f} %", within >= 99, ">= 99 %")


def check_press(results, data, run):
    """One video that begins and ends at rest; 70 markers."""
    source = data / "gelsight-mini-press" / "mini_example.avi"
    report, frames = run(source, "gelsight_mini_wide"), pictures(source)
    places, trusted = follow(frames, report.places[0], 21, report.pitch_px)
    off = np.where(trusted, np.linalg.norm(places - report.places, axis=2), np.nan)
    drift = np.median(np.linalg.norm(report.shifts[:41], axis=2))
    end, end_90 = np.nanmedian(off[-5:]), np.nanpercentile(off[-5:], 90)
    moved = np.median(np.linalg.norm(report.places[-5:] - report.places[0], axis=2))
    kept = (np.nan_to_num(off).max(0) < 0.25 * report.pitch_px) & trusted[-5:].any(0)
    print(f"\ngelsight-mini-press: {len(report.frames)} reports of {len(frames)} frames; within 1 px "
          f"{percent((off < 1).sum(), trusted.sum()):.2f} %, 90th percentile over the clip "
          f"{np.nanpercentile(off, 90):.3f} px, in the last five frames {end_90:.3f} px; "
          f"declined {(~trusted).sum()} of {trusted.size}; the gel ends {moved:.2f} px from where it began")
    results.add("press: median drift, frames 0-40", f"{drift:.3f} px", drift <= 0.1, "<= 0.1 px")
    figure = "press: from the independent tracker, last five frames, median"
    results.add(figure, f"{end:.3f} px", end <= 0.15, "<= 0.15 px")
    share = f"{kept.sum()} of {kept.size}"
    results.add("press: markers that keep their identity", share, kept.sum() == 70 == kept.size, "70 of 70")


def check_wriggle(results, data, run):
    """Every video from its rest on: what comes before may be dark or an old picture."""
    print(f"\n{'gelsight-mini-wriggle':32} {'frames':>6} {'rest':>6} {'markers':>7} {'matched%':>8} {'within1px%':>10} "
          f"{'declined%':>9} {'frozen':>6} {'lost':>5}")
    videos = sorted((data / "gelsight-mini-wriggle").glob("*/*.avi"))
    ended, frozen, longest, agreed, strayed, trusted_count, all_count = 0, 0, 0, 0, 0, 0, 0
    for source in videos:
        report, frames = run(source, "gelsight_mini_near"), pictures(source)
        ended += report.exit_code == 0 and len(report.frames) == len(frames)
        start = report.header["rest"]["frames"][1] - 1
        ours, reported_lost, frames_count = report.places[start:], report.lost[start:], len(frames)
        frames = frames[start:][: len(ours)]
        places, trusted = follow(frames, ours[0], 25, report.pitch_px)
        off = np.linalg.norm(places - ours, axis=2)
        stuck = 0
        for i in range(len(ours) - 10):
            still = np.ptp(ours[i : i + 11], axis=0).max(1) < 0.05
            moves = trusted[i : i + 11].all(0) & (np.ptp(places[i : i + 11], axis=0).max(1) > 1)
            stuck += (still & moves).sum()
        seen = visible(frames, places, trusted, report.radius_px, report.pitch_px)
        elsewhere = np.linalg.norm(seen - ours, axis=2) > 0.2 * report.pitch_px  # False where it is not in view
        in_view = np.isfinite(seen).all(2)
        lost = longest_run(in_view & (reported_lost | elsewhere))
        frozen, longest = frozen + stuck, max(longest, lost)
        agreed, trusted_count = agreed + (off[trusted] < 1).sum(), trusted_count + trusted.sum()
        strayed, all_count = strayed + (off[trusted] > 0.5 * report.pitch_px).sum(), all_count + trusted.size
        matched = 100 - percent(reported_lost.sum(), reported_lost.size)
        name = source.parent.name + " " + source.stem[-1]
        print(f"{name:32} {frames_count:6} {start:6} {report.markers_count:7} {matched:8.2f} "
              f"{percent((off[trusted] < 1).sum(), trusted.sum()):10.2f} "
              f"{percent((~trusted).sum(), trusted.size):9.2f} {stuck:6} {lost:5}")
    print(f"within 1 px of the independent tracker {percent(agreed, trusted_count):.2f} %, "
          f"more than half a pitch off {strayed} times; "
          f"(marker, frame) pairs it declined: {all_count - trusted_count} of {all_count}")
    figure = "wriggle: videos judged to the end, a report for every frame"
    results.add(figure, f"{ended} of {len(videos)}", ended == len(videos) > 0, "all")
    results.add("wriggle: 10-frame spells of a marker frozen while it moves", str(frozen), frozen == 0, "0")
    results.add("wriggle: frames in a row that a marker is in view and lost", str(longest), longest <= 25, "<= 25")


CHECKS = {"lift": check_lift, "press": check_press, "wriggle": check_wriggle}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"some of {', '.join(CHECKS)} (default: all)")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the reports here")
    arguments = parser.parse_args()
    for part in arguments.parts:
        if part not in CHECKS:
            parser.error(f"expected some of {', '.join(CHECKS)}, got {part}")
    named = os.environ.get("SLIPBOUND_DATA")
    data = Path(named) if named else PROJECT.parent / "shared" / "data"
    if not data.is_dir():
        print("check_tracking: SKIPPED, no SLIPBOUND_DATA and no ../shared/data")
        return 0
    binary = os.environ.get("SLIPBOUND_BINARY")
    if not binary:
        subprocess.run(["cargo", "build", "--quiet", "--release", "-p", "slipbound-cli"], cwd=PROJECT, check=True)
        binary = Path(os.environ.get("CARGO_TARGET_DIR", PROJECT / "target")) / "release" / "slipbound"
    results = Results()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for part in arguments.parts or CHECKS:
            CHECKS[part](results, data, lambda source, sensor: watch(binary, source, sensor, folder))
    return 1 if results.report() else 0


if __name__ == "__main__":
    sys.exit(main())
