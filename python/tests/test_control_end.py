"""How the loop around ports written in Python ends: by a fault, and where it is left."""

from __future__ import annotations

import pytest
from test_control import FRAME_NS, Jaws, loop

import slipbound
from slipbound.control import GripperState


@pytest.fixture(scope="module")
def held() -> list[slipbound.lab.SimulatedFrame]:
    """The finger at rest for a second, then pressed for four."""
    scene = "ramp?object=scissors&force_n=15&rest_frames=30&ramp_s=4&grid=fast&seed=3"
    return list(slipbound.lab.simulate(scene))


class Weak(Jaws):
    """Takes every force and exerts 5 N."""

    def poll(self) -> GripperState:
        state = super().poll()
        force_n = None if state.target_n is None else 5.0
        return GripperState(state.time_ns, force_n=force_n, target_n=state.target_n, jaws=state.jaws)


def seconds(hold_s: float) -> str:
    return f"[lift]\nlift_mm = 0.0\nhold_ns = {round(hold_s * 1e9)}\n"


def clock():
    return iter(range(0, 10**12, FRAME_NS)).__next__


@pytest.mark.parametrize(("hold_s", "last"), [(1.0, "commanded"), (60.0, "source_ended")])
def test_what_is_held_to_the_end_with_a_fault_is_not_held(held, sensor, hold_s, last):
    """As `slipbound hold`: the end of a time, or of a source, is not the end of the work then."""
    seen: list[slipbound.control.Cycle] = []
    options = {"controller": "constant", "settings": seconds(hold_s), "observer": seen.append}
    control, _, wrist = loop(held, sensor, Weak(), **options)
    with pytest.raises(slipbound.ControlError, match="expected 10.0 N per finger, measured 5.0 N for too long$") as left:
        control.run(clock())
    assert (left.value.kind, seen[-1].fault_kind) == ("fault", "force_shortfall")
    assert seen[-1].outcome == last and seen[-1].has_ended == (last == "commanded")
    assert wrist.told[-1] == "pause"
    assert not any(cycle.is_over() for cycle in seen[:-1])
    # Without a fault the same is a result.
    control, _, _ = loop(held, sensor, **options)
    assert control.run(clock()).is_over()


@pytest.mark.parametrize(("blind_n", "told_n"), [(None, []), (8.0, []), (30.0, [30.0])])
def test_a_hand_that_is_left_stands_and_is_held_no_looser(held, sensor, blind_n, told_n):
    blind = "" if blind_n is None else f"[grip]\nblind_force_n = {blind_n}\n"
    control, gripper, wrist = loop(held, sensor, controller="constant", settings=blind + seconds(60.0))
    for n in range(60):
        control.cycle(n * FRAME_NS)
    told_count, motions_count = len(gripper.told), len(wrist.told)
    control.leave()
    assert (gripper.told[told_count:], wrist.told[motions_count:]) == (told_n, ["pause"])


class Unplugged(Jaws):
    """Gone from the 40th state on."""

    def __init__(self, error: slipbound.GripperError) -> None:
        super().__init__(fails_at=40, error=error)


@pytest.mark.parametrize("kind", ["link", "other"])
def test_faults_and_what_left_the_loop_have_kinds_to_match(held, sensor, kind):
    seen: list[slipbound.control.Cycle] = []
    control, _, _ = loop(held, sensor, Unplugged(slipbound.GripperError("cable out", kind)), observer=seen.append)
    for n in range(50):
        control.cycle(n * FRAME_NS)
    assert [cycle.fault_kind for cycle in seen[38:40]] == [None, f"gripper_{kind}"]
    with pytest.raises(slipbound.ControlError, match="cable out; waited 20 s") as left:
        control.cycle(39 * FRAME_NS + 20 * 10**9)
    assert left.value.kind == "fault"

    class Untold(Jaws):
        def poll(self) -> GripperState:
            return GripperState(0, jaws="holding")

    control, _, _ = loop(held, sensor, Untold())
    with pytest.raises(slipbound.ControlError, match="any command could lower it") as left:
        for n in range(30):
            control.cycle(n * FRAME_NS)
    assert left.value.kind == "held_force_unknown"
