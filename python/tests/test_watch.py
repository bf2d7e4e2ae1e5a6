"""Recordings and scenes: the lines of the command line, byte for byte."""

from __future__ import annotations

import contextlib
import csv
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import slipbound
from conftest import ROOT, SCENE, recordings


def lines_of_the_command(source: str, folder: Path, *arguments: str) -> list[str]:
    file = folder / "report.jsonl"
    file.unlink(missing_ok=True)
    command = [sys.executable, "-m", "slipbound", "watch", source, "--json", str(file), "--markers", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 3), done.stderr
    return file.read_text().splitlines()[1:]


def lines_of_python(source: str, **options: str) -> list[str]:
    return [report.to_json(markers=True) for report in slipbound.watch(source, **options)]


@pytest.mark.filterwarnings("ignore:.* is torn:RuntimeWarning")
@pytest.mark.parametrize(
    "source",
    [
        f"sim:{SCENE}",
        f"sim:{SCENE}&fault=drop=0.1,torn=0.2",
        "sim:press?camera=gelsight_mini&object=scissors&hold_s=0.2&grid=fast&seed=4",
    ],
)
def test_simulated_scenes_give_the_lines_of_the_command(source, tmp_path):
    expected = lines_of_the_command(source, tmp_path)
    assert len(expected) > 10 and lines_of_python(source) == expected


def test_a_recording_gives_the_lines_of_the_command(tmp_path):
    source = str(ROOT / "testdata" / "twist.avi")
    options = {"sensor": str(ROOT / "testdata" / "painted.toml")}
    expected = lines_of_the_command(source, tmp_path, "--sensor", options["sensor"])
    assert len(expected) > 5 and lines_of_python(source, **options) == expected
    paper = lines_of_the_command(source, tmp_path, "--sensor", options["sensor"], "--settings", "paper")
    assert lines_of_python(source, settings="paper", **options) == paper
    held = tmp_path / "held.toml"
    held.write_text("[rest]\nheld = true\n")
    told = lines_of_the_command(source, tmp_path, "--sensor", options["sensor"], "--rest", "held")
    assert lines_of_python(source, settings=str(held), **options) == told != expected
    assert slipbound.watch(source, settings=str(held), **options).rest_kind == "in_contact"


@pytest.mark.filterwarnings("ignore:.* is torn:RuntimeWarning")
@pytest.mark.parametrize("fault", ["drop=0.5,torn=0.3", "dead=5,late=0.3"])
def test_simulated_frames_have_the_faults_of_those_that_are_watched(frames, fault):
    faulty = list(slipbound.lab.simulate(SCENE, fault=fault))
    with slipbound.watch(f"sim:{SCENE}&fault={fault}") as watched:
        seen = [(report.seq, watched.image()) for report in watched]
    assert [frame.seq for frame in faulty] == [seq for seq, _ in seen]
    for frame, (seq, image) in zip(faulty, seen):
        whole = next(f for f in frames if f.seq == seq)
        assert frame.truth.to_dict() | {"events": None} == whole.truth.to_dict() | {"events": None}
        if image is None:
            assert frame.torn.startswith("JPEG cut off") and whole.jpeg.startswith(frame.jpeg)
            with pytest.raises(slipbound.FrameError, match=f"frame {seq} that is torn: JPEG cut off"):
                frame.image()
        else:
            assert frame.torn is None and np.array_equal(frame.image(), image)
            assert np.array_equal(image, whole.image()) != ("dead" in fault)
    # Those of a dropped frame are told with the next one.
    events = [event for frame in faulty for event in frame.truth.events]
    assert {"first_contact", "gross"} <= set(events)
    assert events == [event for frame in frames if frame.seq <= faulty[-1].seq for event in frame.truth.events]
    assert len(faulty) == len(frames) if "drop" not in fault else any(image is None for _, image in seen)


def test_a_torn_frame_is_warned_of_with_its_file_and_reason(tmp_path):
    folder = tmp_path / "run"
    command = [sys.executable, "-m", "slipbound", "simulate", f"{SCENE}", "-o", str(folder)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    images = sorted(folder.glob("*.jpg"))
    images[-1].write_bytes(b"")
    images[-2].write_bytes(images[-2].read_bytes()[:2000])
    expected = lines_of_the_command(str(folder), tmp_path, "--sensor", str(folder / "sensor.toml"))
    with pytest.warns(RuntimeWarning) as warned:
        assert lines_of_python(str(folder), sensor=str(folder / "sensor.toml")) == expected
    cut, empty = [str(warning.message) for warning in warned]
    seq = len(images) - 1
    assert empty == f"{folder}: frame {seq} ({images[-1].name}) is torn: empty: zero bytes"
    assert cut.startswith(f"{folder}: frame {seq - 1} ({images[-2].name}) is torn: JPEG cut off: 2000 bytes")
    assert all(Path(warning.filename).name == "test_watch.py" for warning in warned)
    for image in images:
        image.write_bytes(b"")
    with pytest.raises(slipbound.SourceError, match=r"got none; frame 0 \(.*\) is torn: empty: zero bytes"):
        slipbound.watch(folder, sensor=folder / "sensor.toml")


def test_a_recording_brings_its_finger_along(tmp_path):
    folder, recording = tmp_path / "run", tmp_path / "run.mcap"
    for arguments in (["simulate", SCENE, "-o", folder], ["watch", folder, "--record", recording]):
        subprocess.run([sys.executable, "-m", "slipbound", *arguments], capture_output=True, check=True)
    for source in (folder, recording):
        expected = lines_of_the_command(str(source), tmp_path)
        assert len(expected) > 10 and lines_of_python(str(source)) == expected, source
        assert slipbound.watch(source).sensor.name == "gelslim_sim"
    (folder / "sensor.toml").write_text("pich_px = 3\n")
    with pytest.raises(slipbound.SettingError, match="sensor.toml: .*pich_px"):
        slipbound.watch(folder)


class Camera:
    """Serves these images over HTTP 60 times a second, the last one for ever, to one client at a time."""

    def __init__(self, jpegs: list[bytes]) -> None:
        self.jpegs, self.sent_count, self.pauses = jpegs, 0, threading.Event()
        self.server = socket.create_server(("127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{self.server.getsockname()[1]}/"
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self) -> None:
        self.client, _ = self.server.accept()
        self.client.recv(1 << 12)
        self.client.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=a\r\n\r\n")
        with contextlib.suppress(OSError):  # the client has left
            while not self.pauses.wait(1 / 60):
                jpeg = self.jpegs[min(self.sent_count, len(self.jpegs) - 1)]
                self.client.sendall(b"--a\r\nContent-Length: %d\r\n\r\n%s\r\n" % (len(jpeg), jpeg))
                self.sent_count += 1


def test_of_a_camera_the_newest_frame_is_judged_and_it_is_free_again_when_closed(frames, sensor):
    camera = Camera([frame.jpeg for frame in frames])
    watched = slipbound.watch(camera.address, sensor=sensor)
    for _ in range(watched.settings.to_dict()["rest"]["window_count"]):
        next(watched)
    seqs = []
    for _ in range(10):
        time.sleep(0.2)
        seqs.append(next(watched).seq)
    assert camera.sent_count - seqs[-1] < 30 and seqs[-1] - seqs[0] > 60, (camera.sent_count, seqs)
    camera.pauses.set()
    watched.close()
    with contextlib.suppress(ConnectionResetError):
        assert camera.client.recv(1, socket.MSG_DONTWAIT) == b""


def test_close_ends_the_wait_of_another_thread_for_a_camera_that_is_silent(frames, sensor):
    camera = Camera([frame.jpeg for frame in frames])
    watched = slipbound.watch(camera.address, sensor=sensor)
    raised: list[BaseException] = []

    def work() -> None:
        try:
            for _ in watched:
                pass
        except slipbound.Error as error:
            raised.append(error)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    camera.pauses.set()
    time.sleep(0.5)
    watched.close()
    thread.join(2)
    assert not thread.is_alive() and isinstance(raised[0], slipbound.ClosedError)


def value_of(cell: str) -> float | bool | str | None:
    """The value of a cell of a table."""
    with contextlib.suppress(ValueError):
        return float(cell)
    return {"": None, "true": True, "false": False}.get(cell, cell)


@pytest.mark.filterwarnings("ignore:.* is torn:RuntimeWarning")
def test_rows_are_those_of_the_command_and_a_column_has_one_type(tmp_path):
    source, file = f"sim:{SCENE}&fault=drop=0.1,torn=0.2", tmp_path / "run.csv"
    command = [sys.executable, "-m", "slipbound", "watch", source, "--csv", str(file)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 3
    with file.open(newline="") as table:
        expected = [{name: value_of(cell) for name, cell in row.items()} for row in csv.DictReader(table)]
    rows = slipbound.rows(slipbound.watch(source))
    assert rows == expected and any(row["reason"] == "torn frame" for row in rows)
    for name in rows[0]:
        types = {type(row[name]) for row in rows if row[name] is not None}
        assert len(types) <= 1, (name, types)


def test_whole_numbers_of_a_table_are_exact_where_one_is_unknown(monitor, frames):
    pandas = pytest.importorskip("pandas")
    time_ns = 1_700_000_000_123_456_789
    table = slipbound.to_pandas([monitor.step(frames[0].image(), time_ns=time_ns), monitor.step(frames[0].image())])
    assert table.time_ns[0] == time_ns and table.time_ns[1] is pandas.NA
    assert {str(table[name].dtype) for name in ("seq", "markers_lost", "margin_age_frames")} == {"Int64"}
    assert list(slipbound.to_pandas([]).columns) == list(table.columns)
    most = (1 << 64) - 1
    table = slipbound.to_pandas([monitor.step(frames[0].image(), time_ns=t) for t in (None, most)])
    assert table.time_ns[0] is pandas.NA and table.time_ns[1] == most
    assert (str(table.time_ns.dtype), str(table.seq.dtype)) == ("UInt64", "Int64")


def clips() -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Real recordings and the finger of each: those that every run compares, and the others."""
    all_files = list(recordings())
    lifts = [p for p in all_files if p.is_dir() and p.parent.name == "gelsight-lift"]
    lifts = lifts or [p for p in {p.parent for p in all_files if "gelsight-lift" in str(p) and p.suffix == ".jpg"}]
    press = [p for p in all_files if p.suffix == ".avi" and "press" in p.parent.name]
    presses = [p.parent for p in all_files if p.parent.name == "gelslim3-press" and p.name == "ref.jpg"]
    wriggle = [p for p in all_files if p.suffix == ".avi" and "wriggle" in str(p)]
    fingers = [("gelsight", sorted(lifts)), ("gelsight_mini_wide", press), ("gelslim3", presses)]
    near = [(str(clip), "gelsight_mini_near") for clip in wriggle]
    return [(str(clip), finger) for finger, some in fingers for clip in some] + near[:4], near[4:]


@pytest.mark.skipif(not clips()[0], reason="no recordings")
@pytest.mark.parametrize("which", ["in every run", "the others"])
def test_recordings_give_the_lines_of_the_command(tmp_path, which):
    every_run, others = clips()
    if which == "the others" and os.environ.get("SLIPBOUND_CLIPS") != "all":
        pytest.skip(f"{len(others)} more recordings are compared by SLIPBOUND_CLIPS=all, as in `.ci/run full`")
    compared_count = 0
    for clip, finger in every_run if which == "in every run" else others:
        expected = lines_of_the_command(clip, tmp_path, "--sensor", finger)
        assert lines_of_python(clip, sensor=finger) == expected, clip
        compared_count += len(expected)
    assert compared_count > 100


def test_image_table_and_overlay(frames):
    with slipbound.watch(f"sim:{SCENE}", finger="left") as watched:
        assert watched.image() is None and watched.clock == "device" and watched.rest_kind == "unloaded"
        first = next(watched)
        assert first.finger == "left"
        image = watched.image()
        assert np.array_equal(image[:, :, ::-1], watched.image(order="RGB"))
        assert slipbound.overlay(image, first).shape[2] == 3
        *_, last = watched
        assert last.seq == frames[-1].seq and np.array_equal(watched.image(), frames[-1].image())
    pandas = pytest.importorskip("pandas")
    table = slipbound.watch(f"sim:{SCENE}").to_pandas()
    assert isinstance(table, pandas.DataFrame)
    assert {"state", "contact_area_px2", "margin_value", "motion_translation_px_x"} <= set(table.columns)
    assert (table.seq.diff().dropna() > 0).all() and table.state.isin(["incipient", "gross"]).any()


def test_the_command_line_is_the_programs():
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([sys.executable, "-m", "slipbound", *arguments], capture_output=True, text=True)

    sensors = run("sensors")
    assert sensors.returncode == 0 and "gelslim3" in sensors.stdout
    assert run("nonsense").returncode == 2
    missing = run("watch", "no/such/file.avi")
    assert missing.returncode == 2 and "no/such/file.avi" in missing.stderr
    # A build in a clone adds its commit.
    assert run("--version").stdout.split()[:2] == ["slipbound", slipbound.__version__]
