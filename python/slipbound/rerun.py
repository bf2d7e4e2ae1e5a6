"""Reports in the Rerun viewer. Needs rerun-sdk: ``pip install './python[rerun]'`` in a checkout.

Under the name of a finger there are ``image`` (its camera image as given, rectified or not), ``markers`` and
``slip`` (arrows in px of the rectified image), the scalars ``margin``, ``stick_ratio``, ``contact_area_px2``,
``grip_n`` and ``slipping_markers``, and ``state``, a text line at every change of the verdict.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ._slipbound import Report

__all__ = ["blueprint", "log"]

#: The last logged verdict, by recording and name of the finger.
_last_state: dict[tuple[str | None, str], str] = {}
#: The scalars and their columns in ``Report.to_row``.
_NUMBERS = {
    "margin": "margin_value",
    "stick_ratio": "stick_ratio_value",
    "contact_area_px2": "contact_area_px2",
    "grip_n": "grip_n",
    "slipping_markers": "slip_markers_over",
}
_LEVELS = {"incipient": rr.TextLogLevel.WARN, "gross": rr.TextLogLevel.ERROR, "unjudged": rr.TextLogLevel.WARN}


def log(
    report: Report,
    image: NDArray[np.uint8] | None = None,
    *,
    order: Literal["BGR", "RGB"] = "BGR",
    recording: Any = None,
) -> None:
    """Log a report and its frame.

    Parameters
    ----------
    report : Report
        The report of :meth:`slipbound.Monitor.step` or :func:`slipbound.watch`.
    image : array or None
        The frame.
    order : {"BGR", "RGB"}
        Order of its channels.
    recording : rerun.RecordingStream or None
        The target; None is the active one.
    """
    name = report.finger
    rr.set_time("frame", sequence=report.seq, recording=recording)
    if report.time_ns is None:
        rr.disable_timeline("time", recording=recording)
    else:
        rr.set_time("time", duration=report.time_ns * 1e-9, recording=recording)
    if image is not None:
        model = "L" if image.ndim == 2 or image.shape[2] == 1 else order
        rr.log(f"{name}/image", rr.Image(image, color_model=model), recording=recording)
    field = report.field
    if len(field) > 0:
        moved = rr.Arrows2D(origins=field.rest_px, vectors=field.now_from_rest_px, colors=[255, 200, 0])
        rr.log(f"{name}/markers", moved, recording=recording)
        seen = field.matched & field.in_contact
        slips = rr.Arrows2D(origins=field.now_px[seen], vectors=field.slip_px[seen], colors=[160, 0, 200])
        rr.log(f"{name}/slip", slips, recording=recording)
    row = report.to_row()
    for key, column in _NUMBERS.items():
        value = row[column]
        if isinstance(value, (int, float)):
            rr.log(f"{name}/{key}", rr.Scalars(value), recording=recording)
    key_of_state = (rr.get_recording_id(recording), name)
    if _last_state.get(key_of_state) != report.state:
        _last_state[key_of_state] = report.state
        text = report.state if report.reason is None else f"{report.state}: {report.reason}"
        level = _LEVELS.get(report.state, rr.TextLogLevel.INFO)
        rr.log(f"{name}/state", rr.TextLog(text, level=level), recording=recording)


def blueprint(finger: str = "finger") -> Any:
    """Return a layout: the image with its arrows, the numbers below, the verdicts beside them.

    Parameters
    ----------
    finger : str
        The name of the finger in the reports.

    Returns
    -------
    rerun.blueprint.Blueprint
        For ``rr.send_blueprint``, or ``default_blueprint`` of a recording.
    """
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                rrb.Spatial2DView(origin=f"{finger}/image", name="camera"),
                rrb.Spatial2DView(
                    origin=finger, contents=[f"{finger}/markers", f"{finger}/slip"], name="markers, rectified"
                ),
            ),
            rrb.Horizontal(
                rrb.TimeSeriesView(origin=finger, contents=[f"{finger}/margin", f"{finger}/stick_ratio"]),
                rrb.TextLogView(origin=f"{finger}/state"),
            ),
        )
    )
