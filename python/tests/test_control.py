"""The loop around ports written in Python, and the simulated hand."""

from __future__ import annotations

import copy
import gc
import pickle
import re
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import slipbound
from slipbound.control import (
    SILENT,
    TORN,
    ControlLoop,
    Controller,
    Finger,
    FrameSource,
    Gripper,
    GripperState,
    TaskSettings,
    Wrist,
    WristCommand,
    WristState,
)

FRAME_NS = 33_333_333


class Recorded(FrameSource):
    """Frames from a list; raises at one of them."""

    def __init__(self, frames, fails_at: int | None = None, error: BaseException | None = None) -> None:
        self.frames, self.at, self.fails_at, self.error = frames, 0, fails_at, error

    def next(self):
        if self.at == self.fails_at:
            raise self.error
        if self.at >= len(self.frames):
            return None
        frame = self.frames[self.at]
        self.at += 1
        return frame.image(), frame.time_ns


class Jaws(Gripper):
    """Accepts every force; raises at a call."""

    def __init__(self, fails_at: int | None = None, error: BaseException | None = None) -> None:
        self.told: list[float | None] = []
        self.polls, self.fails_at, self.error = 0, fails_at, error

    def command(self, force_n: float | None) -> None:
        self.told.append(force_n)

    def poll(self) -> GripperState:
        self.polls += 1
        if self.fails_at is not None and self.polls >= self.fails_at:
            raise self.error
        force_n = self.told[-1] if self.told else None
        return GripperState(self.polls * FRAME_NS, force_n=force_n, target_n=force_n, jaws="holding" if self.told else "open")


class Arm(Wrist):
    """Records its commands."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def command(self, command: WristCommand) -> None:
        self.told.append(command.motion)

    def poll(self) -> WristState:
        return WristState(0)


def loop(frames, sensor, gripper=None, wrist=None, **options):
    source = options.pop("source", None) or Recorded(frames)
    gripper, wrist = gripper or Jaws(), wrist or Arm()
    return ControlLoop([Finger(source, sensor)], gripper, wrist, **options), gripper, wrist


@pytest.fixture(scope="module")
def still():
    """The finger at rest for a second, then pressed and pulled."""
    scene = slipbound.lab.simulate("ramp", object="scissors", force_n=15, rest_frames=30, ramp_s=2, grid="fast", seed=3)
    return list(scene)


def run(control: ControlLoop, count: int):
    return [control.cycle(n * FRAME_NS) for n in range(count)]


def test_the_loop_holds_with_python_ports(still, sensor):
    seen: list[str] = []
    control, gripper, _ = loop(still, sensor, observer=lambda cycle: seen.append(cycle.outcome))
    last = control.run(iter(range(0, 10**12, FRAME_NS)).__next__)
    assert last.outcome == "source_ended" and seen[0] == "at_rest" and "commanded" in seen
    assert gripper.told and all(force_n is not None and force_n >= 5 for force_n in gripper.told)


def test_a_record_of_a_cycle(still, sensor):
    control, _, _ = loop(still, sensor)
    cycle = run(control, 40)[-1]
    record = cycle.to_dict()
    assert record["grip_command"] == {"jaws": "hold", "force_n": cycle.force_n}
    assert cycle.reports[0].finger == "finger0" and cycle.image().shape == (480, 640, 3)
    with pytest.raises(IndexError, match="finger 3 of 1"):
        cycle.image(3)


class Boom(Exception):
    """An exception that no library raises by itself."""


class Ramp(Controller):
    """A newton more in every cycle."""

    def __init__(self, fails_at: int | None = None) -> None:
        self.count, self.fails_at = 0, fails_at

    def decide(self, now_ns: int, hand: dict[str, Any], gripper: GripperState) -> float:
        self.count += 1
        if self.count == self.fails_at:
            raise Boom("controller")
        assert hand["state"] in ("no_contact", "unsure", "stick", "incipient", "gross")
        return 10.0 + self.count


def test_a_controller_written_in_python(still, sensor):
    control, gripper, _ = loop(still, sensor, controller=Ramp())
    run(control, len(still))
    assert gripper.told[-1] > gripper.told[0]


@pytest.mark.parametrize("port", ["source", "gripper", "controller", "observer"])
@pytest.mark.parametrize("error", [Boom("here"), KeyboardInterrupt()], ids=["exception", "interrupt"])
def test_an_exception_pauses_the_wrist_keeps_the_force_and_surfaces(still, sensor, port, error):
    options: dict[str, Any] = {"controller": Ramp()}
    if port == "source":
        options["source"] = Recorded(still, 30, error)
    elif port == "gripper":
        options["gripper"] = Jaws(31, error)
    elif port == "controller":

        class Failing(Ramp):
            def decide(self, now_ns, hand, gripper):
                force_n = super().decide(now_ns, hand, gripper)
                if self.count == 5:
                    raise error
                return force_n

        options["controller"] = Failing()
    else:

        def observe(cycle):
            if cycle.outcome == "commanded":
                raise error

        options["observer"] = observe
    control, gripper, wrist = loop(still, sensor, **options)
    before = []
    with pytest.raises(type(error)) as raised:
        for n in range(len(still)):
            before = list(gripper.told)
            control.cycle(n * FRAME_NS)
    assert raised.value is error
    assert wrist.told[-1] == "pause"
    assert None not in gripper.told
    # In the cycle that failed the force did not fall.
    assert not before or gripper.told[-1] >= before[-1]


def test_the_exception_that_ended_a_run_reaches_the_caller_also_where_the_wrist_cannot_be_paused(still, sensor):
    class Stuck(Arm):
        def command(self, command: WristCommand) -> None:
            raise RuntimeError("the arm is gone, too")

    wrist = Stuck()
    control, *_ = loop(still, sensor, source=Recorded(still, 3, OSError("no camera")), wrist=wrist)
    with pytest.raises(OSError, match="no camera") as raised:
        control.run(iter(range(0, 10**12, FRAME_NS)).__next__)
    notes = getattr(raised.value, "__notes__", [repr(raised.value.__context__)])
    assert any("the arm is gone, too" in note for note in notes), notes


def test_a_fault_that_a_gripper_reports_is_waited_for(still, sensor):
    gripper = Jaws(30, slipbound.GripperError("my gripper: no link", "link"))
    control, _, wrist = loop(still, sensor, gripper=gripper)
    cycles = run(control, 40)
    assert cycles[-1].outcome == "waiting" and "no link" in cycles[-1].fault and wrist.told[-1] == "pause"
    with pytest.raises(slipbound.ControlError, match="no link; waited"):
        control.cycle(60_000_000_000)


def test_what_a_port_returns_is_checked(still, sensor):
    class Wrong(Jaws):
        def poll(self):
            return 3

    control, _, wrist = loop(still, sensor, gripper=Wrong())
    with pytest.raises(TypeError):
        control.cycle(0)
    assert wrist.told[-1] == "pause"
    with pytest.raises(slipbound.SettingError, match="jaws"):
        GripperState(0, jaws="ajar")
    with pytest.raises(slipbound.SettingError, match="finite"):
        GripperState(0, force_n=float("nan"))
    control, _, _ = loop(still, sensor, source=Recorded([]))
    assert control.cycle(0).outcome == "source_ended"
    for wrong in ({"task": "juggle"}, {"controller": "tight"}, {"settings": "[grip]\nleast_n = -1\n"}):
        with pytest.raises(slipbound.SettingError):
            loop(still, sensor, **wrong)
    with pytest.raises(slipbound.SettingError, match="fingers"):
        ControlLoop([], Jaws(), Arm())


def test_a_wrong_array_from_a_source_surfaces(still, sensor):
    class Wrong(Recorded):
        def next(self):
            return np.zeros((3, 3))

    control, _, wrist = loop(still, sensor, source=Wrong([]))
    with pytest.raises(slipbound.FrameError, match="float64"):
        control.cycle(0)
    assert wrist.told == ["pause"]


def test_a_simulated_hand(still):
    hand = slipbound.lab.Hand("lift", seed=1, fingers=1, mu=0.6, longest_s=1.5, grid="fast")
    last = hand.run()
    assert last.outcome == "source_ended" and hand.truth["grip_force_n"] > 5 and hand.score["most_n"] >= 10
    with pytest.raises(slipbound.SettingError):
        slipbound.lab.Hand("lift", nonsense=1)


def test_a_circle_through_a_loop_is_collected(still, sensor):
    class Robot(Recorded, Jaws):
        """Its own source and gripper; owns its loop."""

        def __init__(self) -> None:
            Recorded.__init__(self, still)
            Jaws.__init__(self)
            finger = Finger(self, sensor, rest=[frame.image() for frame in still[:5]])
            self.control = ControlLoop([finger], self, Arm(), controller=Held(self))

    class Held(Controller):
        def __init__(self, robot) -> None:
            self.robot = robot

        def decide(self, now_ns, hand, gripper):
            return 10.0

    class Thinker(Held):
        def __init__(self) -> None:
            super().__init__(None)
            self.hand = slipbound.lab.Hand("lift", controller=self, seed=1, fingers=1, grid="fast")

    def made(kind):
        one = kind()
        one.control.cycle(0) if kind is Robot else one.hand.cycle()
        return weakref.ref(one)

    alive = [made(kind) for kind in (Robot, Thinker, Robot, Thinker)]
    gc.collect()
    assert [one() for one in alive] == [None] * 4
    # An object in use stays.
    robot = Robot()
    gc.collect()
    assert robot.control.cycle(0).outcome == "commanded"


def test_a_controller_that_fails_keeps_a_simulated_object():
    controller = Ramp(fails_at=25)
    hand = slipbound.lab.Hand("lift", controller=controller, seed=1, fingers=1, longest_s=4)
    with pytest.raises(Boom):
        hand.run()
    assert hand.truth["grip_force_n"] > 20


class Gapped(Recorded):
    """Reports at some frames that none came, or that one is torn."""

    def __init__(self, frames, gaps: dict[int, object]) -> None:
        super().__init__(frames)
        self.calls, self.gaps = 0, gaps

    def next(self):
        self.calls += 1
        return self.gaps[self.calls] if self.calls in self.gaps else super().next()


def test_what_a_source_returns_instead_of_a_frame_goes_to_other_processes():
    for thing in (SILENT, TORN):
        assert pickle.loads(pickle.dumps(thing)) is thing is copy.deepcopy(thing)


@pytest.mark.parametrize(("gap", "reports"), [(SILENT, False), (TORN, True)], ids=["silent", "torn"])
def test_a_source_that_gives_no_frame_does_not_end_the_loop(still, sensor, gap, reports):
    control, gripper, _ = loop(still, sensor, source=Gapped(still, {32: gap, 33: gap}))
    cycles = run(control, 36)
    assert [cycle.outcome for cycle in cycles[30:]] == ["commanded"] * 6
    for cycle in cycles[31:33]:
        report = cycle.reports[0]
        assert (report is not None) == reports
        assert report is None or (report.state == "unjudged" and "torn" in report.reason)
        assert (cycle.image() is None) == reports, "a torn frame is no image; a silent camera's newest is the last one"
    # A silent camera sent nothing to number; torn frames have numbers.
    assert cycles[33].reports[0].seq == (33 if reports else 31)
    assert gripper.told[-1] is not None


def test_a_finger_has_a_name_a_rest_frame_and_a_mounting(still, sensor, tmp_path):
    at_rest = [frame.image() for frame in still[:5]]

    def made(**of_finger):
        finger = Finger(Recorded(still[5:]), sensor, **of_finger)
        return ControlLoop([finger], Jaws(), Arm())

    cycle = made(name="thumb", rest=at_rest, turn_rad=0.1).cycle(0)
    assert cycle.outcome == "commanded" and cycle.reports[0].finger == "thumb"
    assert made().cycle(0).outcome == "at_rest"
    with pytest.raises(slipbound.SettingError, match="turn_rad"):
        made(turn_rad=50.0)
    with pytest.raises(slipbound.SettingError, match="rest: expected"):
        made(rest="now")
    with pytest.raises(slipbound.SettingError, match=r"fingers\[1\].side: expected fingers on both sides, got `left` for all 2"):
        ControlLoop([Finger(Recorded(still), sensor) for _ in range(2)], Jaws(), Arm())
    with pytest.raises(slipbound.SettingError, match="no two alike, got `thumb`"):
        ControlLoop([Finger(Recorded(still), sensor, name="thumb") for _ in range(2)], Jaws(), Arm())
    pressed = Finger(Recorded(still[-30:]), sensor, refuses_touch=True)
    with pytest.raises(slipbound.ControlError, match="touch"):
        run(ControlLoop([pressed], Jaws(), Arm()), 30)


def test_the_controller_of_the_settings_is_used_unless_one_is_given(still, sensor):
    constant = 'controller = "constant"\n'
    told = []
    for given in ({}, {"controller": "on_slip"}):
        control, gripper, _ = loop(still, sensor, settings=constant, **given)
        run(control, len(still))
        told.append(set(gripper.told))
    assert told[0] == {10.0} < told[1]
    scene = {"seed": 1, "fingers": 1, "mu": 0.35, "longest_s": 6, "grid": "fast"}
    hand = slipbound.lab.Hand("lift", settings=constant, **scene)
    hand.run()
    assert hand.score["most_n"] == 10


def test_settings_of_a_task_as_text_object_and_file(still, sensor, tmp_path):
    text = "[grip]\nstart_n = 17.0\n"
    file = tmp_path / "task.toml"
    file.write_text(text)
    settings = TaskSettings.from_toml(text)
    assert settings == TaskSettings(file) != TaskSettings() and settings.to_dict()["grip"]["start_n"] == 17.0
    for thing in (settings, TaskSettings()):
        assert TaskSettings.from_toml(thing.to_toml()) == thing == copy.deepcopy(thing)
        assert pickle.loads(pickle.dumps(thing)) == thing
    for given in (text, settings, file, str(file)):
        control, gripper, _ = loop(still, sensor, settings=given)
        run(control, 30)
        assert gripper.told[0] == 17.0, given
        hand = slipbound.lab.Hand("lift", settings=given, seed=1, fingers=1, longest_s=1, grid="fast")
        hand.run()
        assert hand.score["most_n"] >= 17.0, given
    with pytest.raises(slipbound.SettingError, match="nothing.toml"):
        loop(still, sensor, settings=Path("nothing.toml"))


def test_what_a_task_goes_by_every_finger_must_tell(still, sensor):
    """The shear in mm; with the literal law of the paper screwing ends on slip alone."""
    bare = slipbound.Sensor.from_toml(re.sub(r"(?m)^(pitch|gel)_mm.*$", "", sensor.to_toml()))
    assert bare.pitch_mm is None
    fingers = [Finger(Recorded(still), sensor), Finger(Recorded(still), bare, side="right")]
    for controller in ("on_slip", "margin", Ramp()):
        with pytest.raises(slipbound.SettingError, match="pitch_mm"):
            ControlLoop(fingers, Jaws(), Arm(), task="screw", controller=controller)
    ControlLoop(fingers, Jaws(), Arm(), task="screw", controller="paper")
    ControlLoop(fingers, Jaws(), Arm(), task="lift", controller="on_slip")


def test_a_clock_that_runs_backwards_pauses_the_wrist_and_raises(still, sensor):
    control, gripper, wrist = loop(still, sensor)
    run(control, 30)
    told = list(gripper.told)
    with pytest.raises(slipbound.SettingError, match=f"now_ns: expected at least {29 * FRAME_NS}"):
        control.cycle(28 * FRAME_NS)
    assert wrist.told[-1] == "pause" and gripper.told == told
