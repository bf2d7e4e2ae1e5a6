"""What can go wrong, as exceptions. All are :class:`Error`; most are also the built-in exception that fits."""

from __future__ import annotations


class Error(Exception):
    """Anything that slipbound raises by itself."""


class SettingError(Error, ValueError):
    """A setting, a sensor file or an argument that cannot be: the text names the key, what was expected and what was got.

    Attributes
    ----------
    errno, filename : int or None, str or None
        Of a file that cannot be read: as an :class:`OSError` has them; else None.
    """

    errno: int | None = None
    filename: str | None = None


class FrameError(Error, ValueError):
    """An array that is no picture: of another type of numbers, another shape, or empty."""


class RestError(Error, ValueError):
    """The frames given make no rest frame: none is stationary and bright, or too few markers show."""


class CalibrationError(Error, ValueError):
    """Pictures from which no sensor can be made; the text says why."""


class SourceError(Error, OSError):
    """A source of frames that failed.

    Attributes
    ----------
    kind : str
        What a caller can act on: ``settings``, ``unreadable``, ``format``, ``disconnected``, ``unsupported``, ``other``.
    errno, filename : int or None, str or None
        Where a file is behind it; ``errno`` is None when its content is what failed.
    """

    kind: str = "other"

    def __str__(self) -> str:
        # OSError would put number and file before a text that has them already.
        return str(self.args[0]) if self.args else ""


class ClosedError(Error, ValueError):
    """A source that was closed, or was opened in another process."""


class BusyError(Error, RuntimeError):
    """Two threads use one monitor, simulation or loop at the same time: give each thread its own."""


class GripperError(Error, RuntimeError):
    """A failure that a gripper reports; raised by a :class:`slipbound.control.Gripper`, the loop waits for it to go.

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
    """A failure that a wrist reports; raised by a :class:`slipbound.control.Wrist`, the loop waits for it to go.

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
    """The control loop was left before its task ended. The wrist was paused first, the gripper keeps its force."""


class InternalError(Error, RuntimeError):
    """A fault inside slipbound. Please report it with its text."""
