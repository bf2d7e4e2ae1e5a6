"""Data logged to Rerun can be read back."""

from __future__ import annotations

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
