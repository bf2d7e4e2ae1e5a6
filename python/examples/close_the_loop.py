"""The control loop around a gripper, a wrist and a camera of your own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import slipbound
from slipbound.control import (
    ControlLoop,
    Cycle,
    Finger,
    FrameSource,
    Gripper,
    GripperState,
    Wrist,
    WristCommand,
    WristState,
)

FRAME_NS = 33_333_333


class MyCamera(FrameSource):
    """Stands for your camera: a finger at rest, pressed and pulled."""

    def __init__(self) -> None:
        self.simulation = slipbound.lab.simulate("ramp", object="scissors", rest_frames=30, grid="fast", seed=3)

    def next(self) -> tuple[NDArray[np.uint8], int] | None:
        """Return the next frame and its time."""
        frame = next(self.simulation, None)
        return None if frame is None else (frame.image(), frame.time_ns)


class MyGripper(Gripper):
    """Stands for your driver: send and return, do not wait for the jaws."""

    force_n: float | None = None
    time_ns = 0

    def command(self, force_n: float | None) -> None:
        """Take over a force; raise slipbound.GripperError(text, "refused") for one that cannot be."""
        self.force_n = force_n

    def poll(self) -> GripperState:
        """Return what was heard of last."""
        self.time_ns += FRAME_NS
        return GripperState(self.time_ns, target_n=self.force_n, jaws="open" if self.force_n is None else "holding")


class MyWrist(Wrist):
    """Stands for your arm."""

    def command(self, command: WristCommand) -> None:
        """Take over a motion, for command.time_to_live_ns."""

    def poll(self) -> WristState:
        """Return where it is."""
        return WristState(0)


def show(cycle: Cycle) -> None:
    """Print when a slip begins."""
    if cycle.slips_count > show_count[0]:
        show_count[0] = cycle.slips_count
        print(f"{cycle.now_ns * 1e-9:.2f} s: slip {cycle.slips_count}, hold with {cycle.force_n} N")


show_count = [0]


def main() -> None:
    """Run the loop until the camera ends; a simulated clock stands for time.monotonic_ns."""
    clock = iter(range(0, 10**12, FRAME_NS))
    loop = ControlLoop([Finger(MyCamera(), MyCamera().simulation.sensor)], MyGripper(), MyWrist(), observer=show)
    last = loop.run(lambda: next(clock))
    print(f"ended: {last.outcome}")


if __name__ == "__main__":
    main()
