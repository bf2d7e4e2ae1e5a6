"""Runs the speed bench and its rivals once, and writes bench/speed.json and bench/speed.md. See bench/speed.sh."""

import json
import math
import os
import platform
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FINGERS = ["smooth", "fabric", "rectified"]
MOST_RISE = 1.03
# What a monitor may take, MiB.
MOST_MIB = 8.0
# Frames between which instructions are counted; the first ones of a contact cost less.
FEW, MANY = 20, 110
# How often OpenCV, the peers and the fingers are run in turn, and how often each call of theirs in a turn.
TURNS, CALLS_A_TURN, STARTS = 40, 5, 7


# Why the lines have steps.
STEPS = [
    "The jumps of smooth are real: contact and evidence are computed in cells of 4, 8 or 16 px, the largest of at most 0.17 pitch (up to 0.36 where there",
    "would be more than 10,000 cells); from one cell size to the next their number changes fourfold.",
]


def bench(program, *arguments):
    return json.loads(subprocess.run([program, *map(str, arguments)], check=True, stdout=subprocess.PIPE).stdout)


def instructions(program, finger, frames_count):
    """Instructions inside the monitor's step over so many frames."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["valgrind", "--tool=callgrind", "--toggle-collect=*SlipMonitor*step_probed*"]
        command += [f"--callgrind-out-file={folder}/out", program, "judge", finger, str(frames_count)]
        said = subprocess.run(command, check=True, capture_output=True, text=True).stderr
    return int(re.search(r"Collected\s*:\s*(\d+)", said)[1])


def instructions_per_frame(program, finger):
    counted = instructions(program, finger, MANY) - instructions(program, finger, FEW)
    if counted <= 0:
        sys.exit(f"{finger}: nothing was measured: callgrind counted {counted} instructions in {MANY - FEW} frames")
    return counted / (MANY - FEW)


def check(program):
    known = json.loads((ROOT / "bench/speed.json").read_text())
    print(f"{'finger':10} {'recorded':>12} {'now':>12} {'ratio':>6} {'MiB':>5}  (instructions a frame; memory of a monitor)")
    risen = large = False
    for finger in FINGERS:
        before, now = known[finger]["instructions_per_frame"], instructions_per_frame(program, finger)
        if now < before / 2:
            sys.exit(f"{finger}: not all was measured: {now:.0f} instructions a frame, recorded {before:.0f}; if a frame takes so few, run bench/speed.sh")
        mib = bench(program, "memory", finger)["monitor_mib"]
        risen |= now > MOST_RISE * before
        large |= mib > MOST_MIB
        print(f"{finger:10} {before:12.0f} {now:12.0f} {now / before:6.3f} {mib:5.1f}")
    if risen:
        sys.exit("instructions a frame rose by more than 3 %: make it faster, or run bench/speed.sh and say why")
    if large:
        sys.exit(f"a monitor takes more than {MOST_MIB:.0f} MiB")


def peers():
    """What others do a frame: a tracker as vendors' kits have it, and dense flow. Our own restatement in calls of OpenCV."""
    import cv2
    import numpy as np
    from opencv_baseline import painted_frame

    cv2.setNumThreads(1)
    frame = painted_frame()
    grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
    moved = np.roll(grey, 2, axis=1)

    def tracker():
        light = cv2.GaussianBlur(frame, (63, 63), 0)
        darker = cv2.subtract(light, frame)
        mask = cv2.inRange(darker, (15, 15, 15), (255, 255, 255))
        mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        return [cv2.moments(contour) for contour in contours]

    dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    return {
        "marker tracker: blur, threshold, contours, moments": tracker,
        "dense flow, DIS, fast": lambda: dis.calc(grey, moved, None),
        "dense flow, Farneback": lambda: cv2.calcOpticalFlowFarneback(grey, moved, None, 0.5, 3, 15, 3, 5, 1.2, 0),
    }


def in_turn(program):
    """Rows of what OpenCV's list, the peers and the fingers took in one turn, ms: a machine that is slow for a while is slow for all of them."""
    from opencv_baseline import opencv_steps, painted_frame, timed

    frame, others = painted_frame(), peers()
    fingers = {f: subprocess.Popen([program, "turns", f], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for f in FINGERS}
    rows = []
    # The first turn warms up.
    for _ in range(1 + TURNS):
        row = {name: timed(call, runs_count=CALLS_A_TURN, warm_up_count=1)[0] for name, call in others.items()}
        row["OpenCV"] = sum(ms for _, _, ms in opencv_steps(frame, runs_count=CALLS_A_TURN, warm_up_count=1))
        for finger, process in fingers.items():
            process.stdin.write("\n")
            process.stdin.flush()
            said = json.loads(process.stdout.readline())
            row |= {finger: said["step_us"] / 1000, f"copy for {finger}": said["copy_us"] / 1000}
        rows.append(row)
    for process in fingers.values():
        process.communicate()
    return rows[1:]


def ratio(rows, over, under):
    """The tenth, the half and nine tenths of a ratio in the turns."""
    found = sorted(row[over] / row[under] for row in rows)
    return [found[round(share * (len(found) - 1))] for share in (0.1, 0.5, 0.9)]


def straightness(rows, of):
    """Slope and intercept of a line through the medians, and the largest residual over the largest median."""
    xs, ys = [row[of] for row in rows], [row["step_us_median"] for row in rows]
    x0, y0 = sum(xs) / len(xs), sum(ys) / len(ys)
    slope = sum((x - x0) * (y - y0) for x, y in zip(xs, ys)) / sum((x - x0) ** 2 for x in xs)
    worst = max(abs(y - y0 - slope * (x - x0)) for x, y in zip(xs, ys))
    return slope, y0 - slope * x0, worst / max(ys)


def ticks(most):
    """From 0 in round steps, about five of them, to the first that is not below `most`."""
    rough = most / 5
    power = 10 ** math.floor(math.log10(rough))
    step = next(f * power for f in (1, 2, 2.5, 5, 10) if f * power >= rough)
    return [step * i for i in range(math.ceil(most / step - 1e-9) + 1)]


def plot(growth, of, path):
    """The medians against pixels or markers as an SVG, a line a finger."""
    width, height, left, right, top, bottom = 640, 360, 56, 32, 20, 48
    rows = [row for finger in growth.values() for row in finger[of]]
    unit, scale = {"pixels": ("megapixels", 1e-6), "markers": ("markers", 1)}[of]
    xs = ticks(max(row[f"{of}_count"] for row in rows) * scale)
    ys = ticks(max(row["step_us_median"] for row in rows) / 1000)
    x = lambda v: left + (width - left - right) * v / xs[-1]
    y = lambda v: height - bottom - (height - bottom - top) * v / ys[-1]
    colours = {"smooth": "#0072b2", "fabric": "#c75200", "rectified": "#cc79a7"}
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">']
    parts.append(f'<rect width="{width}" height="{height}" fill="white"/>')
    for v in ys:
        parts.append(f'<path d="M{left} {y(v):.1f}H{width - right}" stroke="#ddd"/>')
        parts.append(f'<text x="{left - 6}" y="{y(v) + 4:.1f}" text-anchor="end">{v:g}</text>')
    for v in xs:
        parts.append(f'<path d="M{x(v):.1f} {height - bottom}v5" stroke="#888"/>')
        parts.append(f'<text x="{x(v):.1f}" y="{height - bottom + 19}" text-anchor="middle">{v:,g}</text>')
    for i, (finger, both) in enumerate(growth.items()):
        colour, points = colours[finger], [(row[f"{of}_count"] * scale, row["step_us_median"] / 1000) for row in both[of]]
        line = " ".join(f"{x(a):.1f},{y(b):.1f}" for a, b in points)
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts += [f'<circle cx="{x(a):.1f}" cy="{y(b):.1f}" r="3" fill="{colour}"/>' for a, b in points]
        beside = top + 20 + 18 * i
        parts.append(f'<rect x="{left + 8}" y="{beside - 14}" width="92" height="18" fill="white"/>')
        parts.append(f'<path d="M{left + 12} {beside - 4}h18" stroke="{colour}" stroke-width="2"/>')
        parts.append(f'<text x="{left + 36}" y="{beside}" fill="{colour}">{finger}</text>')
    parts.append(f'<text x="{(left + width - right) / 2}" y="{height - 8}" text-anchor="middle">{unit}</text>')
    middle = (height - bottom + top) / 2
    parts.append(f'<text x="16" y="{middle}" transform="rotate(-90 16 {middle})" text-anchor="middle">ms a frame</text></svg>')
    path.write_text("\n".join(parts) + "\n")


def plots(growth):
    for of in ["pixels", "markers"]:
        plot(growth, of, ROOT / f"bench/speed-{of}.svg")


def growth_lines(growth):
    lines = ["| finger | ms a Mpx | us a marker | largest residual, of the largest median |", "|---|---|---|---|"]
    for finger, both in growth.items():
        (pixel, _, off), (marker, _, off_markers) = straightness(both["pixels"], "pixels_count"), straightness(both["markers"], "markers_count")
        lines.append(f"| {finger} | {1e3 * pixel:.2f} | {marker:.2f} | {100 * off:.0f} %, {100 * off_markers:.0f} % |")
    return lines


def measure_growth(program):
    return {finger: bench(program, "growth", finger) for finger in FINGERS}


def only_growth(program):
    """Growth measured anew: its plots and its table, and nothing else of the page."""
    growth = measure_growth(program)
    plots(growth)
    file = ROOT / "bench/speed.md"
    text = file.read_text().split("\n")
    first = next(i for i, line in enumerate(text) if line.startswith("| finger | ms a Mpx"))
    last = next(i for i in range(first, len(text)) if not text[i])
    text[first:last] = growth_lines(growth)
    file.write_text("\n".join(text))
    print("\n".join(growth_lines(growth)))
    print(json.dumps(growth))


def page(result, rows, growth, fingers, memory, frames_count):
    model = next((l.split(":")[1].strip() for l in Path("/proc/cpuinfo").read_text().splitlines() if l.startswith("model name")), "?")
    load = os.getloadavg()[0]
    lines = [
        "# Speed of a frame",
        "",
        f"`bench/speed.sh --frames {frames_count}`, one run. {os.cpu_count()} cores of {model}, {platform.system()}; load before: "
        f"{LOAD_BEFORE:.1f}, after: {load:.1f}. 640x480 colour in memory, 391 markers, in contact, grip force known, one core; {frames_count} frames",
        "per finger, 90 Hz. A copy is one memcpy of a frame, over the same twelve frames in turn that the monitor gets.",
        "",
        "Averaged in, because not done in every frame: the contact region and the evidence of the imprint run in every third frame, and, as no marker is missing, the full marker search in every fifth",
        "(`contact.period_ms`, `markers.search_period_ms`, `evidence.period_ms`: 25 ms; cameras of up to 40 Hz get everything in every frame). Median: of the means of 30",
        "consecutive frames. 99.9th percentile: of single frames; it includes interruptions by the machine. Slowest: the largest of the medians of the 60 positions of frame and steps in a turn,",
        "which is what the steps themselves add. Copies' tail: 99.9th percentile over median of as many consecutive copies as take as long as a step, in",
        "alternation with the steps; it is what the machine adds to work of that length. At 30 Hz: the median of a camera for which every frame gets everything.",
        "",
        f"Copies and OpenCV: OpenCV's fixed list of calls (`bench/opencv_baseline.py`, without matching, evidence and estimates), the peers, 300 frames of each finger and 60 copies, {TURNS} times in alternation; the",
        "median of the ratios and, in brackets, their 10th and 90th percentile.",
        "",
        "| finger | median us | slowest us | over median | 99.9th us | over median | copies' tail | at 30 Hz us | a copy us | copies | OpenCV / ours | instructions a frame | MiB |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for finger in FINGERS:
        r = result[finger]
        copies, opencv = r["memcpy_ratio_spread"], r["opencv_ratio_spread"]
        lines.append(
            f"| {finger} | {r['step_us_median']:.0f} | {r['step_us_dearest']:.0f} | {r['step_us_dearest'] / r['step_us_median']:.2f} "
            f"| {r['step_us_p999']:.0f} | {r['step_us_p999'] / r['step_us_median']:.1f} | {r['copies_tail_ratio']:.1f} | {r['step_us_at_30_hz']:.0f} "
            f"| {r['memcpy_us_median']:.1f} | {copies[1]:.1f} ({copies[0]:.1f} to {copies[2]:.1f}) | {opencv[1]:.1f} ({opencv[0]:.1f} to {opencv[2]:.1f}) "
            f"| {r['instructions_per_frame'] / 1e6:.2f} M "
            f"| {memory[finger]:.1f} |"
        )
    lines += ["", "| finger | imprint | contact | markers | motion | slip | evidence | verdict | (us, medians of 30 frames in a row)", "|---|---|---|---|---|---|---|---|---|"]
    for finger in FINGERS:
        steps = result[finger]["steps_us_median"]
        names = ["imprint", "contact", "markers", "motion", "slip", "evidence", "verdict"]
        lines.append(f"| {finger} | " + " | ".join(f"{steps[name]:.0f}" for name in names) + " | |")
    starts = ", ".join(f"{result[finger]['start_ms']:.0f} ms {finger}" for finger in FINGERS)
    lines += ["", f"Start: from the last of ten frames of the untouched finger to a monitor that can judge, the first of a process, median of {STARTS}: {starts}."]
    median_ms = lambda name: sorted(row[name] for row in rows)[len(rows) // 2]
    lines += ["", "| others | ms | over ours: smooth | fabric | rectified |", "|---|---|---|---|---|"]
    for name in ["OpenCV", *peers()]:
        over = " | ".join(f"{ratio(rows, name, finger)[1]:.1f}" for finger in FINGERS)
        lines.append(f"| {name} | {median_ms(name):.2f} | {over} |")
    lines += ["", "## Growth", "", "![against pixels](speed-pixels.svg) ![against markers](speed-markers.svg)", ""]
    lines += growth_lines(growth)
    lines += ["", "Pixels: 320x240 to 1920x1440 with the same 391 markers; markers: 35 to 4,900 on 1280x960.", *STEPS, "", "## Many fingers", ""]
    lines += [f"Monitors at 90 Hz on {fingers['cores_count']} cores, smooth gel; late: processed after the next frame was due. Over 100 %: it took longer than the recording lasts.", ""]
    lines += ["| monitors | late | of | cores in use |", "|---|---|---|---|"]
    lines += [f"| {r['monitors_count']} | {r['late_count']} | {r['judged_count']} | {100 * r['cores_in_use_fraction']:.0f} % |" for r in fingers["rows"]]
    return "\n".join(lines) + "\n"


def main():
    program, arguments = sys.argv[1], sys.argv[2:]
    if "--check" in arguments:
        return check(program)
    if "--growth" in arguments:
        return only_growth(program)
    frames_count = int(arguments[arguments.index("--frames") + 1]) if "--frames" in arguments else 20000
    sys.path.insert(0, str(ROOT / "bench"))
    result = {finger: bench(program, "measure", finger, frames_count) for finger in FINGERS}
    rows = in_turn(program)
    growth = measure_growth(program)
    fingers = bench(program, "fingers", "smooth", 5)
    memory = {finger: bench(program, "memory", finger)["monitor_mib"] for finger in FINGERS}
    for finger in FINGERS:
        starts = [bench(program, "start", finger) for _ in range(STARTS)]
        result[finger]["start_ms"] = statistics.median(start["first_ms"] for start in starts)
    for finger in FINGERS:
        for name, spread in [("opencv", ratio(rows, "OpenCV", finger)), ("memcpy", ratio(rows, finger, f"copy for {finger}"))]:
            result[finger][f"{name}_ratio"] = spread[1]
            result[finger][f"{name}_ratio_spread"] = spread
        result[finger]["instructions_per_frame"] = instructions_per_frame(program, finger)
    (ROOT / "bench/speed.json").write_text(json.dumps(result, indent=1) + "\n")
    plots(growth)
    text = page(result, rows, growth, fingers, memory, frames_count)
    (ROOT / "bench/speed.md").write_text(text)
    print(text)


LOAD_BEFORE = os.getloadavg()[0]
if __name__ == "__main__":
    main()
