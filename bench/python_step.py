"""What Monitor.step costs in Python: over the same step in Rust, and beside OpenCV's calls from Python on the same frame.

Medians of the processor time of the thread, which a loaded machine disturbs less than the clock on the wall; OpenCV has one thread. The step
in Rust and from Python is judged in alternation. ``python bench/python_step.py [ROUNDS [CAMERA ...]]``; needs the wheel and
opencv-python-headless.
"""

from __future__ import annotations

import os
import statistics
import sys
import time

import cv2
import numpy as np

import slipbound
from opencv_baseline import opencv_steps

#: Rounds that do not count.
WARM_UP_ROUNDS = 5


def compare(monitor: slipbound.Monitor, image: np.ndarray, rounds: int, count: int = 10) -> tuple[float, float]:
    """Return the median us of a step in Rust alone, and the median of what Python adds to it, round by round."""
    rust, added, contiguous = [], [], np.ascontiguousarray(image)
    for n in range(rounds + WARM_UP_ROUNDS):
        start_ns = time.thread_time_ns()
        monitor._time_steps(contiguous, count)
        between_ns = time.thread_time_ns()
        for _ in range(count):
            monitor.step(image)
        end_ns = time.thread_time_ns()
        if n >= WARM_UP_ROUNDS:
            rust.append((between_ns - start_ns) * 1e-3 / count)
            added.append((end_ns - between_ns) * 1e-3 / count - rust[-1])
    return statistics.median(rust), statistics.median(added)


def layouts(image: np.ndarray) -> list[tuple[str, np.ndarray, str]]:
    """The frame as programs hand it over: name, array, order of its channels."""
    canvas = np.zeros((image.shape[0] + 4, image.shape[1] + 4, 3), np.uint8)
    canvas[2:-2, 2:-2] = image
    return [
        ("BGR, contiguous", image, "BGR"),
        ("RGB view of it", image[:, :, ::-1], "RGB"),
        ("one channel, contiguous", image[:, :, 1].copy(), "BGR"),
        ("crop", canvas[2:-2, 2:-2], "BGR"),
        ("upside down, `[::-1]`", image[::-1].copy()[::-1], "BGR"),
        ("mirrored, `[:, ::-1]`", image[:, ::-1].copy()[:, ::-1], "BGR"),
        ("BGRA, `[:, :, :3]`", np.dstack([image, image[:, :, :1]])[:, :, :3], "BGR"),
        ("one channel, `[:, :, 1]`", image[:, :, 1], "BGR"),
        ("transposed", image.transpose(1, 0, 2).copy().transpose(1, 0, 2), "BGR"),
        ("planes, `transpose(1, 2, 0)`", image.transpose(2, 0, 1).copy().transpose(1, 2, 0), "BGR"),
    ]


def main() -> None:
    """Print the tables of bench/python.md."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print(f"slipbound {slipbound.__version__}, cv2 {cv2.__version__}, {rounds} rounds, load of the machine {os.getloadavg()[0]:.1f}\n")
    over = ["| camera | array | in Rust | Python adds |", "|---|---|---|---|"]
    beside = ["| camera | Monitor.step | OpenCV's calls | times |", "|---|---|---|---|"]
    for camera in sys.argv[2:] or ("gelsight_mini", "gelslim"):
        simulation = slipbound.lab.simulate("press", camera=camera, object="scissors", hold_s=0.3, seed=3)
        frames = [frame.image() for frame in simulation]
        name = f"{camera} {frames[-1].shape[1]}x{frames[-1].shape[0]}"
        for layout, array, order in layouts(frames[-1]):
            rest = frames[0] if order == "BGR" else frames[0][:, :, ::-1]
            rest = rest if array.ndim == 3 else frames[0][:, :, 1]
            monitor = slipbound.Monitor(simulation.sensor, rest=rest, order=order)
            rust_us, added_us = compare(monitor, array, rounds)
            over.append(f"| {name} | {layout} | {rust_us:.0f} us | {added_us:.1f} us, {100 * added_us / rust_us:.1f} % |")
            if array is frames[-1]:
                theirs_ms = sum(ms for _, _, ms in opencv_steps(array, time.thread_time, rounds))
                ours_ms = (rust_us + added_us) * 1e-3
                beside.append(f"| {name} | {ours_ms:.2f} ms | {theirs_ms:.2f} ms | {theirs_ms / ours_ms:.1f} |")
    print("\n".join(over), "\n\n", "\n".join(beside), sep="")


if __name__ == "__main__":
    main()
