"""All exceptions. Each is an :class:`Error`; most are also the built-in exception that fits."""

from __future__ import annotations

from typing import Any


class Error(Exception):
    """Base of everything that slipbound raises by itself."""


class SettingError(Error, ValueError):
    """An invalid setting, sensor file or argument: the text names the key, what was expected and what was got.

    Attributes
    ----------
    errno, filename : int or None, str or None
        For a file that cannot be read: as in an :class:`OSError`; else None.
    """

    errno: int | None = None
    filename: str | None = None


class FrameError(Error, ValueError):
    """An array that is not an image: of another number type, another shape, or empty."""


class RestError(Error, ValueError):
    """The given frames yield no rest frame: none is stationary and bright, or too few markers show."""


class CalibrationError(Error, ValueError):
    """Images from which no sensor can be made; the text says why."""


class SourceError(Error, OSError):
    """A source of frames that failed.

    Attributes
    ----------
    kind : str
        For callers to act on: ``settings``, ``unreadable``, ``format``, ``disconnected``, ``unsupported``, ``other``.
    errno, filename : int or None, str or None
        Where a file failed; ``errno`` is None when its content failed.
    """

    kind: str = "other"

    def __str__(self) -> str:
        # OSError would put number and file before a text that contains them already.
        return str(self.args[0]) if self.args else ""

    def __reduce__(self) -> tuple[Any, ...]:
        # OSError passes number and file on only where it was made of them.
        return type(self), self.args, {**self.__dict__, "errno": self.errno, "filename": self.filename}


class ClosedError(Error, ValueError):
    """A source that was closed, or was opened in another process."""


class BusyError(Error, RuntimeError):
    """Two threads use one monitor, simulation or loop at the same time: give each thread its own."""


class GripperError(Error, RuntimeError):
    """A failure that a gripper reports; if a :class:`slipbound.control.Gripper` raises it, the loop waits for it to end.

    Parameters
    ----------
    message : str
        What was expected and what was got.
    kind : str
        ``link``, ``unanswered``, ``refused``, ``lowering``, ``value``, ``stopped``, ``not_homed``, ``not_ready`` or
        ``other``.
    """

    def __init__(self, message: str, kind: str = "other") -> None:
        super().__init__(message)
        self.kind = kind


class WristError(Error, RuntimeError):
    """A failure that a wrist reports; if a :class:`slipbound.control.Wrist` raises it, the loop waits for it to end.

    Parameters
    ----------
    message : str
        What was expected and what was got.
    kind : str
        ``link``, ``refused`` or ``other``.
    """

    def __init__(self, message: str, kind: str = "other") -> None:
        super().__init__(message)
        self.kind = kind


class ControlError(Error, RuntimeError):
    """The control loop was left before its task ended. The wrist was paused first, the gripper keeps its force.

    Attributes
    ----------
    kind : str
        For callers to act on: ``fault`` (of gripper or wrist, see :attr:`slipbound.control.Cycle.fault_kind`), ``source``,
        ``frame``, ``setting``, ``rest``, ``touched``, ``held_force_unknown``, ``monitor``, ``interrupted``, ``world`` (of a
        simulated hand) or ``other``.
    """

    kind: str = "other"


class InternalError(Error, RuntimeError):
    """A fault inside slipbound. Please report it with its text."""
