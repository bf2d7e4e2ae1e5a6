"""What Monitor.step costs over the same step in Rust: the same frame both ways, in alternation; medians of
the processor time of the thread, which a loaded machine disturbs less than the clock on the wall."""

from __future__ import annotations

import statistics
import sys
import time

import numpy as np

import slipbound


#: Rounds that do not count.
WARM_UP_ROUNDS = 5


def compare(monitor: slipbound.Monitor, image: np.ndarray, rounds: int, count: int = 10) -> tuple[float, float]:
    """Return the median us of a step in Rust alone, and the median of what Python adds to it, round by round."""
    rust, added = [], []
    for n in range(rounds + WARM_UP_ROUNDS):
        start_ns = time.thread_time_ns()
        monitor._time_steps(image, count)
        between_ns = time.thread_time_ns()
        for _ in range(count):
            monitor.step(image)
        end_ns = time.thread_time_ns()
        if n >= WARM_UP_ROUNDS:
            rust.append((between_ns - start_ns) * 1e-3 / count)
            added.append((end_ns - between_ns) * 1e-3 / count - rust[-1])
    return statistics.median(rust), statistics.median(added)


def main() -> None:
    """Print the table of bench/python.md."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print("| camera | array | in Rust | Python adds |\n|---|---|---|---|")
    for camera in sys.argv[2:] or ("gelsight_mini", "gelslim"):
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
