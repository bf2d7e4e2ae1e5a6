"""Simulated fingers and hands with exact ground truth of stick and slip.

>>> import slipbound
>>> simulation = slipbound.lab.simulate("ramp", seed=3, object="scissors", ramp_s=0.4, grid="fast")
>>> frames = list(simulation)
>>> truths = simulation.complete([frame.truth for frame in frames])
>>> truths[-1].margin < 0.1
True
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _slipbound as _native
from ._errors import ControlError
from ._slipbound import HandRun as _HandRun
from ._slipbound import Report, Sensor, Settings, SimulatedFrame, Simulation, TaskSettings, Truth

if TYPE_CHECKING:
    from .control import Controller, Cycle, Observer

__all__ = ["Detector", "Hand", "SimulatedFrame", "Simulation", "Truth", "judge_ramps", "ramps_tables", "simulate"]

Parameter = str | float | bool


def _words(parameters: dict[str, Parameter]) -> list[tuple[str, str]]:
    return [(key, str(value)) for key, value in parameters.items()]


def simulate(scene: str, *, seed: int | None = None, **parameters: Parameter) -> Simulation:
    """Simulate a scene of one finger, frame by frame.

    Parameters
    ----------
    scene : str
        The name of a scene, or ``SCENE?key=value&key=value``; ``python -m slipbound scenes`` lists them.
    seed : int or None
        Seed of the camera noise; the same seed gives the same bytes.
    **parameters
        Keys of the scene: ``object="scissors"``, ``force_n=15``, ``fault="drop=0.02,torn=0.01"``.

    Returns
    -------
    Simulation
        An iterator of :class:`SimulatedFrame`: ``image()``, ``truth``, ``seq``, ``time_ns``. With ``fault`` frames may be missing,
        and ``torn`` says why one did not arrive completely.

    Raises
    ------
    slipbound.SettingError
        When the scene does not take a key or a value.
    """
    return _native.simulate(scene, seed, _words(parameters))


class Hand:
    """A simulated hand at a task, in lock-step: a cycle of the control loop, then 1/30 s of the world.

    Parameters
    ----------
    scene : str
        ``lift``, ``screw``, ``unscrew`` or ``place``, or ``TASK?key=value&key=value``.
    controller : {"on_slip", "margin", "paper", "constant"}, slipbound.control.Controller or None
        The controller of the grip force; None takes that of the settings, which is ``on_slip`` unless they say otherwise.
    settings : TaskSettings, str, path or None
        Settings of the task, as :class:`slipbound.control.ControlLoop` takes them.
    monitor : Settings, str, path or None
        Settings of the fingers' monitors.
    **parameters
        Keys of the scene, ``seed`` too.

    Examples
    --------
    >>> hand = slipbound.lab.Hand("lift", seed=1, fingers=1, mu=0.6, longest_s=1)
    >>> last = hand.run()
    >>> hand.truth["grip_force_n"] > 5
    True
    """

    def __init__(
        self,
        scene: str,
        *,
        controller: str | Controller | None = None,
        settings: TaskSettings | str | PathLike[str] | None = None,
        monitor: Settings | str | PathLike[str] | None = None,
        **parameters: Parameter,
    ) -> None:
        self._run = _HandRun(scene, _words(parameters), controller, settings, monitor)

    def cycle(self, observer: Observer | None = None) -> Cycle:
        """Run one cycle; exceptions of controller or observer are raised, with the wrist paused and the grip kept.

        Parameters
        ----------
        observer : callable or None
            Called with the :class:`slipbound.control.Cycle`.

        Returns
        -------
        slipbound.control.Cycle
            What was measured and commanded.
        """
        return self._run.cycle(observer)

    def run(self, observer: Observer | None = None, *, cycles_after_end: int = 15) -> Cycle:
        """Run cycles until the task has ended and half a second longer, or the scene has.

        Parameters
        ----------
        observer : callable or None
            Called with every :class:`slipbound.control.Cycle`.
        cycles_after_end : int
            How many cycles of 1/30 s follow the end of the task.

        Returns
        -------
        slipbound.control.Cycle
            The last one.

        Raises
        ------
        slipbound.ControlError
            When the loop was left, or a fault of gripper or wrist has ended the work.
        """
        after_count = 0
        while True:
            cycle = self.cycle(observer)
            if not after_count:
                try:
                    cycle.is_over()
                except ControlError:
                    self.leave()
                    raise
            after_count += cycle.has_ended
            if cycle.outcome == "source_ended" or after_count > cycles_after_end:
                return cycle

    def leave(self) -> None:
        """Leave the hand before its task has ended: the wrist pauses, the grip stays, and two seconds pass."""
        self._run.leave()

    @property
    def truth(self) -> dict[str, Any]:
        """The present ground truth; units are in the names."""
        return self._run.truth

    @property
    def score(self) -> dict[str, Any]:
        """The score over the cycles so far: ``succeeded``, ``most_n``, ``slid_mm``, ..."""
        return self._run.score

    @property
    def scene(self) -> str:
        """The scene with all its parameters."""
        return self._run.scene

    @property
    def task(self) -> str:
        """The task."""
        return self._run.task

    def sensor(self, finger: int = 0) -> Sensor:
        """Return the facts of a finger, with the stiffness of its gel.

        Parameters
        ----------
        finger : int
            Its place among the fingers, from 0.

        Returns
        -------
        Sensor
            What a monitor of its frames takes.
        """
        return self._run.sensor(finger)


class Detector(ABC):
    """Your own slip detector, with the same inputs as every rival in ``slipbound eval``.

    Attributes
    ----------
    name : str
        Its name in the tables; not a name that ``slipbound eval`` uses.
    threshold : float
        The score above which it raises the alarm.
    """

    name: str = "mine"
    threshold: float = 1.0

    def begin(self) -> None:
        """Forget everything: a trial begins. Does nothing unless overridden."""

    @abstractmethod
    def see(self, report: Report, image: NDArray[np.uint8]) -> float:
        """Return the score of a frame: larger means stronger evidence of slip, infinity too. NaN never alarms.

        Parameters
        ----------
        report : Report
            The report of a monitor that gets no grip force; ``report.field`` has the markers.
        image : array
            The frame, uint8, H x W x 3, BGR.
        """

    def restart(self) -> None:
        """Take the last frame as the reference: the object is held, the load begins. Does nothing unless overridden."""


def judge_ramps(
    detector: Detector, trials: int = 10, *, seed: int = 0, beside: Sequence[str] = ("ours_frames", "displacement")
) -> list[dict[str, Any]]:
    """Judge a detector by the protocol ``ramps`` of ``slipbound eval``: the same trials, the same definitions.

    Parameters
    ----------
    detector : Detector
        Yours.
    trials : int
        How many trials, the first of the protocol's.
    seed : int
        Seed of the trials.
    beside : sequence of str
        Detectors of ``slipbound eval`` that see the same frames.

    Returns
    -------
    list of dict
        A record for each detector and trial, with the keys of a line of ``trials.jsonl``: ``outcome``, ``f_at_alarm``, ``score``, ...

    Examples
    --------
    >>> class Unresponsive(Detector):
    ...     def see(self, report, image):
    ...         return 0.0
    >>> [(record["detector"], record["outcome"]) for record in judge_ramps(Unresponsive(), 1, beside=[])]
    [('mine', 'missed')]
    """
    records: list[dict[str, Any]] = []
    for number in range(trials):
        records += _native.judge_ramp(detector, detector.name, detector.threshold, (seed, number), list(beside))
    return records


def ramps_tables(records: list[dict[str, Any]]) -> list[str]:
    """Return the tables of ``slipbound eval ramps``.

    Parameters
    ----------
    records : list of dict
        The records of :func:`judge_ramps`.

    Returns
    -------
    list of str
        Tables in Markdown; that of the alarms is the first.
    """
    return _native.ramps_tables(records)
