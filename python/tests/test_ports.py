"""What ports written in Python may return."""

from __future__ import annotations

import re

import pytest
from test_control import FRAME_NS, Ramp, Recorded, loop


class Tupled(Recorded):
    """Returns tuples of a length."""

    def __init__(self, frames, count: int) -> None:
        super().__init__(frames)
        self.count = count

    def next(self):
        return (*super().next(), 1)[: self.count]


class Told(Ramp):
    """Decides what it was told."""

    def __init__(self, told: tuple[object, ...]) -> None:
        super().__init__()
        self.told = told

    def decide(self, now_ns, hand, gripper):
        return self.told


@pytest.mark.parametrize("count", [0, 1, 3])
def test_a_tuple_of_another_length_is_refused_by_the_name_of_its_port(frames, sensor, count):
    frame = "FrameSource.next: expected a frame, (frame, time_ns), SILENT, TORN or None"
    force = "Controller.decide: expected force_n or (force_n, whether the arm goes)"
    for expected, options in (
        (frame, {"source": Tupled(frames, count)}),
        (force, {"source": Recorded(frames), "controller": Told((5.0, True, 1)[:count])}),
    ):
        control, _, wrist = loop(frames, sensor, **options)
        with pytest.raises(TypeError, match=re.escape(f"{expected}, got a tuple of {count}")):
            for n in range(len(frames)):
                control.cycle(n * FRAME_NS)
        assert wrist.told[-1] == "pause"
