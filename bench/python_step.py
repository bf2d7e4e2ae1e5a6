"""What Monitor.step costs over the same step in Rust: the same frame both ways, in alternation; medians."""

from __future__ import annotations

import statistics
import sys
import time

import numpy as np

import slipbound


def compare(monitor: slipbound.Monitor, image: np.ndarray, rounds: int, count: int = 10) -> tuple[float, float]:
    """Return the median us of a step in Rust alone, and the median of what Python adds to it, round by round."""
    rust, added = [], []
    for n in range(rounds + 20):
        inner = statistics.median(monitor._time_steps(image, count)) * 1e-3
        outer = []
        for _ in range(count):
            start = time.perf_counter_ns()
            monitor.step(image)
            outer.append((time.perf_counter_ns() - start) * 1e-3)
        if n >= 20:
            rust.append(inner)
            added.append(statistics.median(outer) - inner)
    return statistics.median(rust), statistics.median(added)


def main() -> None:
    """Print the table of bench/python.md."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print("| camera | array | in Rust | Python adds |\n|---|---|---|---|")
    for camera in ("gelsight_mini", "gelslim"):
        simulation = slipbound.lab.simulate("press", camera=camera, object="scissors", hold_s=0.3, seed=3)
        frames = [frame.image() for frame in simulation]
        image = frames[-1]
        canvas = np.zeros((image.shape[0] + 4, image.shape[1] + 4, 3), np.uint8)
        canvas[2:-2, 2:-2] = image
        size = f"{image.shape[1]}x{image.shape[0]}"
        for layout, array in (("BGR, contiguous", image), ("RGB view of it", image[:, :, ::-1]), ("crop", canvas[2:-2, 2:-2])):
            order = "RGB" if layout.startswith("RGB") else "BGR"
            monitor = slipbound.Monitor(simulation.sensor, rest=np.ascontiguousarray(frames[0]))
            if order == "RGB":
                monitor = slipbound.Monitor(simulation.sensor, rest=frames[0][:, :, ::-1], order="RGB")
            rust_us, added_us = compare(monitor, array, rounds)
            print(f"| {camera} {size} | {layout} | {rust_us:.0f} us | {added_us:.1f} us, {100 * added_us / rust_us:.1f} % |")


if __name__ == "__main__":
    main()
