"""Incipient slip from a camera inside a soft fingertip.

Frames in, verdicts out:

>>> import slipbound
>>> reports = list(slipbound.watch("sim:ramp?object=scissors&force_n=15&ramp_s=0.4&grid=fast&seed=3"))
>>> reports[0].state
'no_contact'
>>> any(report.slips for report in reports)
True

With your own camera: :class:`Monitor` takes one numpy array at a time. Lengths in px are in the rectified image of the
finger: x along the finger, y across it; rotations are positive from x to y.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from . import _slipbound as _native
from . import control, lab
from ._errors import (
    BusyError,
    CalibrationError,
    ClosedError,
    ControlError,
    Error,
    FrameError,
    GripperError,
    InternalError,
    RestError,
    SettingError,
    SourceError,
    WristError,
)
from ._rows import rows, to_pandas
from ._slipbound import (
    Contact,
    Estimate,
    Evidence,
    Field,
    Markers,
    Monitor,
    Motion,
    Report,
    Sensor,
    Settings,
    Shear,
    Slip,
    Watch,
    __version__,
    overlay,
)

__all__ = [
    "BusyError",
    "CalibrationError",
    "ClosedError",
    "Contact",
    "ControlError",
    "Error",
    "Estimate",
    "Evidence",
    "Field",
    "FrameError",
    "GripperError",
    "InternalError",
    "Markers",
    "Monitor",
    "Motion",
    "Report",
    "RestError",
    "Sensor",
    "SettingError",
    "Settings",
    "Shear",
    "Slip",
    "SourceError",
    "Watch",
    "WristError",
    "__version__",
    "calibrate",
    "control",
    "lab",
    "overlay",
    "rows",
    "sensors",
    "to_pandas",
    "watch",
]


def sensors() -> list[str]:
    """Return the names of the built-in fingers.

    Returns
    -------
    list of str
        What ``sensor=`` accepts besides files.

    Examples
    --------
    >>> "gelslim" in slipbound.sensors()
    True
    """
    return _native.sensors_built_in()


def watch(
    source: str | PathLike[str],
    sensor: Sensor | str | PathLike[str] | None = None,
    settings: Settings | str | PathLike[str] | None = None,
    *,
    finger: str = "finger",
) -> Watch:
    """Judge a recording, a camera or a simulated scene frame by frame, as ``slipbound watch`` does.

    Parameters
    ----------
    source : str or path
        An image folder, a pattern, an image, a video file, the address of a camera, or ``sim:SCENE?key=value&key=value``.
        Of a camera the newest frame is judged: where the caller is slower, ``seq`` has gaps.
    sensor : Sensor, str, path or None
        The finger; None takes that of the scene, of ``sensor.toml`` beside the frames, that in a recording of Slipbound, or
        the only built-in one whose frames have this size.
    settings : Settings, str, path or None
        The settings; ``"paper"`` is the paper as written.
    finger : str
        The name of the finger in the reports.

    Returns
    -------
    Watch
        An iterator of :class:`Report`; ``image()`` is the frame of the newest one, ``to_pandas()`` all remaining ones.

    Raises
    ------
    SourceError
        When the source cannot be read.
    SettingError
        When no sensor fits, or a setting is invalid.

    Warns
    -----
    RuntimeWarning
        For every torn frame, with its number, its file and what is wrong with it; its report is ``unjudged``.

    Examples
    --------
    >>> watched = slipbound.watch("sim:ramp?object=scissors&ramp_s=0.3&grid=fast&seed=3")
    >>> watched.sensor.name
    'gelslim_sim'
    >>> table = watched.to_pandas()
    >>> int(table.frame.iloc[-1]) == len(table) - 1
    True
    """
    return _native.watch(source, sensor, settings, finger)


def calibrate(
    image: NDArray[np.uint8] | Sequence[NDArray[np.uint8]],
    *,
    name: str = "finger",
    skin: Literal["smooth", "fabric"] = "smooth",
    flip: Literal["none", "vertical", "horizontal", "both"] = "none",
    polarity: Literal["dark", "bright"] | None = None,
    pitch_mm: float | None = None,
    serial: str | None = None,
    description: str = "Calibrated in Python.",
    order: Literal["BGR", "RGB"] = "BGR",
) -> Sensor:
    """Make the sensor of an unknown finger from images of it at rest.

    Parameters
    ----------
    image : array or sequence of arrays
        One image or several, uint8, H x W x 3 or H x W; also one array of several, N x H x W x 3 or N x H x W.
    name : str
        The name of this kind of finger.
    skin : {"smooth", "fabric"}
        The cover of the gel; images of an untouched finger do not show it.
    flip : {"none", "vertical", "horizontal", "both"}
        The mirroring of the camera image; a grid of markers does not show it.
    polarity : {"dark", "bright"} or None
        Whether markers are dark or bright; None detects it.
    pitch_mm : float or None
        Distance between neighbouring markers on the gel; without it nothing is reported in mm.
    serial : str or None
        Serial number of this one finger.
    description : str
        The origin of the numbers.
    order : {"BGR", "RGB"}
        Order of the channels.

    Returns
    -------
    Sensor
        Its ``to_toml()`` is a sensor file.

    Raises
    ------
    CalibrationError
        When the images show no grid of markers; the text says what they show.

    Examples
    --------
    >>> at_rest = next(slipbound.lab.simulate("ramp", seed=3, camera="gelsight_mini")).image()
    >>> mine = slipbound.calibrate(at_rest, name="mine")
    >>> slipbound.Sensor.from_toml(mine.to_toml()) == mine
    True
    """
    return _native.calibrate(image, name, skin, flip, polarity, pitch_mm, serial, description, order)
