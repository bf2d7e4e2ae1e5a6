"""Data logged to Rerun can be read back."""

from __future__ import annotations

import numpy as np
import pytest

import slipbound
from conftest import SCENE

rr = pytest.importorskip("rerun")


def test_a_recording_is_read_back(tmp_path):
    import slipbound.rerun

    file = tmp_path / "run.rrd"
    recording = rr.RecordingStream("slipbound_test")
    recording.save(file, default_blueprint=slipbound.rerun.blueprint("left"))
    with slipbound.watch(f"sim:{SCENE}", finger="left") as watched:
        count = 0
        for report in watched:
            slipbound.rerun.log(report, watched.image(), recording=recording)
            count += 1
    recording.flush()
    recording.disconnect()
    data = file.read_bytes()
    assert count > 20 and len(data) > 100_000
    for name in (b"left/image", b"left/markers", b"left/slip", b"left/margin", b"left/state"):
        assert name in data or name.replace(b"left/", b"/left/") in data


def test_a_grey_frame_is_logged_as_one_whatever_its_axes(tmp_path, monitor, frames):
    import slipbound.rerun

    chunk = pytest.importorskip("rerun.chunk")
    recording = rr.RecordingStream("slipbound_test")
    recording.save(tmp_path / "run.rrd")
    grey = frames[0].image()[:, :, 1].copy()
    for image in (grey, grey[:, :, np.newaxis]):
        slipbound.rerun.log(monitor.step(image), image, recording=recording)
    recording.flush()
    recording.disconnect()
    parts = chunk.RrdReader(tmp_path / "run.rrd").stream().to_chunks()
    formats = [
        shown
        for part in parts
        if part.entity_path.endswith("/image")
        for shown in part.to_record_batch().column("Image:format").to_pylist()
    ]
    assert len(formats) == 2 and formats[0] == formats[1], formats


def test_every_recording_begins_with_a_verdict(tmp_path):
    import slipbound.rerun

    (report,) = [r for r in slipbound.watch(f"sim:{SCENE}", finger="left") if r.seq == 30]
    for name in ("first.rrd", "second.rrd"):
        recording = rr.RecordingStream("slipbound_test")
        recording.save(tmp_path / name)
        slipbound.rerun.log(report, recording=recording)
        recording.flush()
        recording.disconnect()
        assert b"left/state" in (tmp_path / name).read_bytes(), name


def test_a_frame_without_a_time_has_none_and_one_that_was_not_measured_no_numbers(tmp_path, monitor, frames):
    import slipbound.rerun

    chunk = pytest.importorskip("rerun.chunk")
    file = tmp_path / "run.rrd"
    recording = rr.RecordingStream("slipbound_test")
    recording.save(file)
    image = frames[0].image()
    for report in (monitor.step(image, time_ns=10**9), monitor.step(image), monitor.step(image[::2, ::2].copy())):
        slipbound.rerun.log(report, recording=recording)
    recording.flush()
    recording.disconnect()
    shown = {"contact_area_px2": set(), "state": set()}
    for part in chunk.RrdReader(file).stream().to_chunks():
        kind = part.entity_path.rpartition("/")[2]
        if kind in shown:
            seqs = part.to_record_batch().column("frame").to_pylist()
            shown[kind] |= {(seq, "time" in part.timeline_names) for seq in seqs}
    assert shown == {"contact_area_px2": {(0, True), (1, False)}, "state": {(0, True), (2, False)}}
