"""The control loop around your own sources, gripper and wrist.

Subclass :class:`FrameSource`, :class:`Gripper` and :class:`Wrist`; the loop, the tasks and the controllers are those of
the command line. If one of your methods raises, the wrist is paused, the gripper keeps its force, and
:meth:`ControlLoop.cycle` raises the exception. On a :class:`slipbound.GripperError` or :class:`slipbound.WristError`
the loop waits for the fault to end: the wrist stands meanwhile, and after ten seconds the loop is left.

Newtons are normal force per finger. None of the methods may block for longer than a frame lasts.
"""

from __future__ import annotations

import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _slipbound as _native
from ._slipbound import Cycle, GripperState, NoFrame, Sensor, Settings, TaskSettings, WristCommand, WristState

__all__ = [
    "ControlLoop",
    "Controller",
    "Cycle",
    "Finger",
    "FrameSource",
    "Gripper",
    "GripperState",
    "NoFrame",
    "Observer",
    "SILENT",
    "TORN",
    "TaskSettings",
    "Wrist",
    "WristCommand",
    "WristState",
]

#: What :meth:`FrameSource.next` returns when no frame came in time; more may come.
SILENT = NoFrame.SILENT
#: What it returns when a frame came but cannot be decoded completely.
TORN = NoFrame.TORN

#: An observer: called after every cycle.
Observer = Callable[[Cycle], object]
Task = Literal["screw", "unscrew", "place", "lift"]


class FrameSource(ABC):
    """The source of a finger's frames."""

    @abstractmethod
    def next(self) -> NDArray[np.uint8] | tuple[NDArray[np.uint8], int] | NoFrame | None:
        """Return the next frame, with its time of exposure in ns where that is known.

        :data:`SILENT` when none came in time and :data:`TORN` when it cannot be decoded: the loop goes on, blind for this
        finger in this cycle. None at the end of the source: the loop ends with ``source_ended``.
        """


class Gripper(ABC):
    """A parallel gripper. Neither method waits for the jaws."""

    @abstractmethod
    def command(self, force_n: float | None) -> None:
        """Hold with a force, or open the jaws. If this raises, the force is unchanged.

        Parameters
        ----------
        force_n : float or None
            Normal force per finger in N; None opens the jaws.
        """

    @abstractmethod
    def poll(self) -> GripperState:
        """Return the newest state."""


class Wrist(ABC):
    """The arm behind the hand. Neither method waits for the motion."""

    @abstractmethod
    def command(self, command: WristCommand) -> None:
        """Accept a motion; it ends by itself after ``command.time_to_live_ns`` unless a new one has come.

        Parameters
        ----------
        command : WristCommand
            The motion: to turn, to lower or to pause.
        """

    @abstractmethod
    def poll(self) -> WristState:
        """Return the newest state."""


class Controller(ABC):
    """Decides the grip force. A guard keeps the force within the limits and keeps the grip when the fingers are blind.

    Attributes
    ----------
    alarms_count : int
        How often it responded to slip.
    wants_more : bool
        Whether slip occurred at its largest force.
    """

    alarms_count: int = 0
    wants_more: bool = False

    @abstractmethod
    def decide(self, now_ns: int, hand: dict[str, Any], gripper: GripperState) -> float | tuple[float, bool]:
        """Return the force per finger in N, with False as a second value if the arm must wait.

        Parameters
        ----------
        now_ns : int
            Time of the loop; never goes back.
        hand : dict
            The report of all fingers together: ``hand["state"]``, ``hand["slip"]``, ...
        gripper : GripperState
            The state of the gripper.
        """


@dataclass(frozen=True, eq=False)
class Finger:
    """A finger of the hand.

    Parameters
    ----------
    source : FrameSource
        The source of its frames; without ``rest`` its first frames must show it untouched.
    sensor : Sensor, str or path
        Its facts.
    side : {"left", "right"}
        Its side of the object; several fingers are on both sides.
    settings : Settings, str, path or None
        Settings of its monitor.
    name : str or None
        Its name in reports and messages; None is ``finger0``, ``finger1``, ... in their order.
    rest : "auto", array, sequence of arrays, path or bytes
        The rest frame, as :class:`slipbound.Monitor` takes it. ``"auto"`` finds it among the first frames.
    turn_rad : float
        Angle by which its image is rotated against the finger frame, from x to y.
    refuses_touch : bool
        Whether the loop is left when something touches the finger in the rest frame that ``"auto"`` has found.
    """

    source: FrameSource
    sensor: Sensor | str | PathLike[str]
    side: Literal["left", "right"] = "left"
    settings: Settings | str | PathLike[str] | None = None
    name: str | None = None
    rest: Literal["auto"] | NDArray[np.uint8] | Sequence[NDArray[np.uint8]] | str | PathLike[str] | bytes = "auto"
    turn_rad: float = 0.0
    refuses_touch: bool = False


class ControlLoop:
    """Frames in, commands out, cycle by cycle.

    Parameters
    ----------
    fingers : sequence of Finger
        One to four.
    gripper : Gripper
        The gripper.
    wrist : Wrist
        The wrist.
    task : {"lift", "screw", "unscrew", "place"}
        The task.
    controller : {"on_slip", "margin", "paper", "constant"}, Controller or None
        The controller of the grip force; None takes that of the settings, which is ``on_slip`` unless they say otherwise.
    settings : TaskSettings, str, path or None
        Settings of the task: an object, the text of a file, or its path. A ``str`` with a ``=`` or a line break is text.
    observer : callable or None
        Called with every :class:`Cycle`.
    order : {"BGR", "RGB"}
        Order of the channels of the frames.
    """

    def __init__(
        self,
        fingers: Sequence[Finger],
        gripper: Gripper,
        wrist: Wrist,
        *,
        task: Task = "lift",
        controller: str | Controller | None = None,
        settings: TaskSettings | str | PathLike[str] | None = None,
        observer: Observer | None = None,
        order: Literal["BGR", "RGB"] = "BGR",
    ) -> None:
        rows = [{**vars(f), "name": f"finger{i}" if f.name is None else f.name} for i, f in enumerate(fingers)]
        self._loop = _native.Loop(rows, task, controller, settings, order)
        self._gripper = gripper
        self._wrist = wrist
        self._observer = observer

    def cycle(self, now_ns: int) -> Cycle:
        """Take every finger's next frame, poll gripper and wrist, and command them.

        Parameters
        ----------
        now_ns : int
            Time of the loop; must not go back.

        Returns
        -------
        Cycle
            What was measured and commanded.

        Raises
        ------
        slipbound.SettingError
            When the time goes back: the wrist was paused and the gripper keeps its force.
        slipbound.ControlError
            When the loop was left: the wrist was paused and the gripper keeps its force.
        """
        return self._loop.cycle(now_ns, self._gripper, self._wrist, self._observer)

    def run(self, clock: Callable[[], int] = time.monotonic_ns) -> Cycle:
        """Run cycles as fast as the sources give frames until the task or a source has ended; return the last cycle.

        Whatever ends it, Ctrl-C too, the wrist stands and the gripper keeps its force. As on the command line, work whose
        time is over, or whose source, while gripper or wrist have a fault has ended by that fault: a
        :class:`slipbound.ControlError`.

        Parameters
        ----------
        clock : callable
            Returns the time of the loop in ns; must not go back.

        Returns
        -------
        Cycle
            The last one.

        Raises
        ------
        slipbound.ControlError
            When the loop was left, or a fault has ended the work.
        """
        try:
            cycle = self.cycle(clock())
            while not cycle.is_over():
                cycle = self.cycle(clock())
        except BaseException as error:
            try:
                self.leave()
            except Exception as leaving:
                # The exception that ended the loop is the cause: it reaches the caller.
                if sys.version_info >= (3, 11):
                    error.add_note(f"pausing the wrist failed, too: {leaving!r}")
                else:
                    leaving.__context__, error.__context__ = error.__context__, leaving
            raise
        self.leave()
        return cycle

    def leave(self) -> None:
        """Leave the hand before its task has ended, where no further :meth:`cycle` follows.

        The wrist pauses, then the gripper keeps its force, or holds with ``grip.blind_force_n`` of the settings if that is set and
        higher. :meth:`run` does so by itself, and so does :meth:`cycle` where it raises.
        """
        self._loop.leave(self._gripper, self._wrist)
