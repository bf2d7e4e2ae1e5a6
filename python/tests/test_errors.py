"""Every failure is a Python exception: never a panic, never an abort."""

from __future__ import annotations

import copy
import errno
import os
import pickle
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import slipbound
from conftest import SCENE


@pytest.mark.parametrize(
    ("array", "kind", "text"),
    [
        (np.zeros((320, 427, 3), np.float64), slipbound.FrameError, "got float64 of shape"),
        (np.full((320, 427, 3), np.nan), slipbound.FrameError, "got float64"),
        (np.zeros((320, 427, 3), np.uint16), slipbound.FrameError, "got uint16"),
        (np.zeros((320, 427, 3), np.int8), slipbound.FrameError, "got int8"),
        (np.zeros((320, 427, 3), bool), slipbound.FrameError, "got bool"),
        (np.zeros((320, 427, 3), object), slipbound.FrameError, "got object"),
        (np.zeros((320, 427, 4), np.uint8), slipbound.FrameError, "take the fourth channel off"),
        (np.zeros((320, 427, 2), np.uint8), slipbound.FrameError, "got shape"),
        (np.zeros((2, 320, 427, 3), np.uint8), slipbound.FrameError, "got shape"),
        (np.zeros(100, np.uint8), slipbound.FrameError, "got shape"),
        (np.uint8(3), TypeError, "got numpy.uint8"),
        (np.zeros((0, 427, 3), np.uint8), slipbound.FrameError, "got shape"),
        (np.zeros((320, 0, 3), np.uint8), slipbound.FrameError, "got shape"),
        # 30 GB made of one byte.
        (np.broadcast_to(np.uint8(0), (100_000, 100_000, 3)), slipbound.FrameError, "at most 8192 px a side"),
        ([[1, 2], [3, 4]], TypeError, "got list"),
        (None, TypeError, "got NoneType"),
        (b"\xff\xd8", TypeError, "got bytes"),
    ],
)
def test_what_is_no_picture_is_refused(monitor, array, kind, text):
    with pytest.raises(kind, match=text):
        monitor.step(array)
    if not isinstance(array, np.ndarray) or array.ndim != 4:  # several images to calibrate from
        with pytest.raises((kind, TypeError)):
            slipbound.calibrate(array)


def test_odd_sizes_are_unjudged_and_do_not_panic(monitor, sensor):
    for shape in [(1, 1), (1, 640, 3), (480, 1, 3), (3, 3, 3), (5000, 2), (481, 640, 3)]:
        assert monitor.step(np.zeros(shape, np.uint8)).state == "unjudged"
        with pytest.raises(slipbound.Error):
            slipbound.Monitor(sensor, rest=np.zeros(shape, np.uint8))


@pytest.mark.parametrize("seed", range(4))
def test_noise_is_judged_or_refused(sensor, seed):
    noise = np.random.default_rng(seed).integers(0, 256, (480, 640, 3), np.uint8)
    try:
        monitor = slipbound.Monitor(sensor, rest=noise)
    except slipbound.RestError:
        return
    assert monitor.step(noise).state in ("unjudged", "no_contact", "unsure", "stick", "incipient", "gross")


@pytest.mark.parametrize("grip_n", [float("nan"), float("inf"), -1.0])
def test_forces_that_cannot_be(monitor, frames, grip_n):
    with pytest.raises(slipbound.SettingError, match="grip_n: expected a finite force"):
        monitor.step(frames[0].image(), grip_n=grip_n)


@pytest.mark.parametrize("time_ns", [-1, 1 << 64])
def test_times_that_cannot_be(monitor, frames, time_ns):
    with pytest.raises(slipbound.SettingError, match="time_ns: expected a whole number"):
        monitor.step(frames[0].image(), time_ns=time_ns)


def test_times_too_large_for_a_register(monitor, frames):
    with pytest.raises((slipbound.SettingError, OverflowError)):
        monitor.step(frames[0].image(), time_ns=1 << 200)
    with pytest.raises(TypeError):
        monitor.step(frames[0].image(), time_ns=1.5)


def test_words_that_cannot_be(sensor, frames):
    with pytest.raises(slipbound.SettingError, match="did you mean `gelslim`"):
        slipbound.Monitor("gelslin")
    with pytest.raises(slipbound.SettingError, match='order: expected "BGR" or "RGB", got "BRG"'):
        slipbound.Monitor(sensor, order="BRG")
    with pytest.raises(slipbound.SettingError, match="rest: expected"):
        slipbound.Monitor(sensor, rest="now")
    with pytest.raises(slipbound.RestError):
        slipbound.Monitor(sensor, rest=[])
    with pytest.raises(TypeError):
        slipbound.Monitor(sensor, rest=3)
    with pytest.raises(slipbound.RestError, match="frame 1: .*frame size"):
        slipbound.Monitor(sensor, rest=[frames[0].image(), frames[0].image()[:100]])
    with pytest.raises(slipbound.SettingError, match="pich_px"):
        slipbound.Sensor.from_toml('extends = "gelslim"\npich_px = 3\n')
    with pytest.raises(slipbound.SettingError, match="window_count"):
        slipbound.Settings.from_toml("[rest]\nwindow_count = 0\n")
    with pytest.raises(slipbound.SettingError, match="skin"):
        slipbound.calibrate(frames[0].image(), skin="silk")
    with pytest.raises(slipbound.SettingError, match="no such scene|scene"):
        slipbound.lab.simulate("nonsense")
    with pytest.raises(slipbound.SettingError, match="force_n"):
        slipbound.lab.simulate("ramp", force_n=-3)


def test_sources_that_cannot_be(tmp_path):
    with pytest.raises(slipbound.SourceError) as missing:
        slipbound.watch(tmp_path / "nothing.avi")
    assert missing.value.kind == "settings" and isinstance(missing.value, OSError)
    assert missing.value.errno == errno.ENOENT and missing.value.filename == str(tmp_path / "nothing.avi")
    assert "there is no such file" in str(missing.value)
    (tmp_path / "broken.avi").write_bytes(b"RIFF\0\0")
    with pytest.raises(slipbound.SourceError):
        slipbound.watch(tmp_path / "broken.avi")
    (tmp_path / "empty").mkdir()
    with pytest.raises(slipbound.SourceError):
        slipbound.watch(tmp_path / "empty")


def test_exceptions_go_to_other_processes_with_what_they_say(tmp_path):
    for failing in (
        lambda: slipbound.watch(tmp_path / "nothing.avi"),
        lambda: slipbound.Settings(tmp_path / "nothing.toml"),
    ):
        with pytest.raises(slipbound.Error) as raised:
            failing()
        for thing in (pickle.loads(pickle.dumps(raised.value)), copy.copy(raised.value)):
            assert (type(thing), str(thing)) == (type(raised.value), str(raised.value))
            assert thing.errno == raised.value.errno == errno.ENOENT
            assert thing.filename == raised.value.filename and thing.filename.startswith(str(tmp_path))
            assert getattr(thing, "kind", None) == getattr(raised.value, "kind", None)


def test_files_that_cannot_be_read_have_number_and_name(tmp_path):
    for of in (slipbound.Sensor, slipbound.Settings, slipbound.control.TaskSettings):
        with pytest.raises(slipbound.SettingError) as missing:
            of(tmp_path / "nothing.toml")
        assert (missing.value.errno, missing.value.filename) == (errno.ENOENT, str(tmp_path / "nothing.toml"))
    with pytest.raises(slipbound.SettingError) as wrong:
        slipbound.Settings.from_toml("[rest]\nwindow_count = 0\n")
    assert wrong.value.errno is None and wrong.value.filename is None


def test_what_python_itself_refuses(monitor, frames):
    """The cases that docs/python.md lists as TypeError or OverflowError."""
    image = frames[0].image()
    for wrong in ({"grip_n": "10"}, {"time_ns": 1.5}, {"order": 3}):
        with pytest.raises(TypeError):
            monitor.step(image, **wrong)
    with pytest.raises(OverflowError):
        monitor.step(image, time_ns=1 << 127)
    with pytest.raises(OverflowError):
        slipbound.control.GripperState(-1)
    with pytest.raises(OverflowError):
        slipbound.lab.simulate("ramp", seed=-1)


def test_an_overlay_is_of_the_frame_of_its_report(monitor, frames, sensor):
    report = monitor.step(frames[-1].image())
    assert slipbound.overlay(frames[-1].image(), report).ndim == 3
    small = frames[-1].image()[::2, ::2]
    with pytest.raises(slipbound.FrameError, match="expected the frame that the report is of, 640x480 px, got 320x240 px"):
        slipbound.overlay(small, report)
    unjudged = monitor.step(small[:100])
    assert unjudged.state == "unjudged" and slipbound.overlay(small[:100], unjudged).ndim == 3
    with pytest.raises(slipbound.FrameError):
        slipbound.overlay(frames[-1].image(), unjudged)
    looking = slipbound.Monitor(sensor).step(small)
    assert slipbound.overlay(small, looking).ndim == 3
    with pytest.raises(slipbound.FrameError, match="report is of, 320x240 px, got 640x480 px"):
        slipbound.overlay(frames[-1].image(), looking)


def test_a_closed_source_says_so():
    watched = slipbound.watch(f"sim:{SCENE}")
    next(watched)
    watched.close()
    for use in (lambda: next(watched), watched.image):
        with pytest.raises(slipbound.ClosedError, match="closed"):
            use()
    watched.close()


def test_two_threads_on_one_monitor_get_reports_or_a_clear_error(monitor, frames):
    image, wrong, seqs = frames[-1].image(), [], []

    def work() -> None:
        for _ in range(60):
            try:
                seqs.append(monitor.step(image).seq)
            except slipbound.BusyError:
                pass
            except BaseException as error:  # noqa: BLE001 - any other exception is the failure
                wrong.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong and len(seqs) == len(set(seqs)) and len(seqs) >= 60


def test_the_interpreter_runs_while_a_frame_is_judged(monitor, frames):
    image, count, done = frames[-1].image(), [0], threading.Event()

    def count_up() -> None:
        while not done.is_set():
            count[0] += 1
            time.sleep(0)

    thread = threading.Thread(target=count_up)
    thread.start()
    for _ in range(30):
        monitor.step(image)
    done.set()
    thread.join()
    assert count[0] > 30


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_interpreter_runs_while_a_world_is_made():
    def longest_gap_s(work) -> float:
        gaps, done = [0.0], threading.Event()

        def tick() -> None:
            last = time.monotonic()
            while not done.is_set():
                time.sleep(0.001)
                now = time.monotonic()
                gaps.append(now - last)
                last = now

        other = threading.Thread(target=tick)
        other.start()
        began = time.monotonic()
        try:
            work()
        finally:
            took_s = time.monotonic() - began
            done.set()
            other.join()
        return max(gaps) / took_s

    # The best of three: other programs run here, too.
    assert min(longest_gap_s(lambda: slipbound.lab.simulate("ramp")) for _ in range(3)) < 0.7


def test_a_fork_goes_on_with_a_monitor_and_is_told_of_a_source(monitor, frames):
    watched = slipbound.watch(f"sim:{SCENE}")
    next(watched)
    child = os.fork()
    if child == 0:
        try:
            judged = monitor.step(frames[0].image()).state == "no_contact"
            try:
                next(watched)
            except slipbound.ClosedError as error:
                os._exit(0 if judged and "fork" in str(error) else 4)
            os._exit(5)
        except BaseException:  # noqa: BLE001
            os._exit(6)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert next(watched).seq == 1


def interrupted(program: str, after: str = "ready") -> subprocess.CompletedProcess[str]:
    # A background process of a shell ignores SIGINT, and so would its children.
    heeds = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", heeds + program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline().strip() == after
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    return subprocess.CompletedProcess([], process.returncode, out, err)


def test_ctrl_c_ends_a_watch():
    done = interrupted(
        "import slipbound\n"
        "w = slipbound.watch('sim:press?hold_s=60&grid=fast')\n"
        "try:\n    print('ready')\n    for r in w: pass\n"
        "except KeyboardInterrupt:\n    print('interrupted')\n"
    )
    assert done.stdout.strip() == "interrupted", done.stderr


def test_ctrl_c_ends_the_wait_for_a_camera_that_is_silent():
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer():
            camera, _ = server.accept()
            camera.recv(1 << 12)
            camera.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=a\r\n\r\n")
            held.append(camera)

        held: list[socket.socket] = []
        threading.Thread(target=answer, daemon=True).start()
        done = interrupted(
            "import slipbound\n"
            "try:\n    print('ready')\n"
            f"    slipbound.watch('http://127.0.0.1:{server.getsockname()[1]}/')\n"
            "except KeyboardInterrupt:\n    print('interrupted')\n"
        )
        assert done.stdout.strip() == "interrupted", done.stderr


def torn_camera(server: socket.socket) -> None:
    """Gives a client nothing but torn frames."""
    camera, _ = server.accept()
    camera.recv(1 << 12)
    try:
        camera.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=a\r\n\r\n")
        while True:
            camera.sendall(b"--a\r\nContent-Type: image/jpeg\r\nContent-Length: 4\r\n\r\nhalf\r\n")
            time.sleep(0.02)
    except OSError:
        pass


def test_a_camera_that_gives_only_torn_frames_is_an_error_after_5_s_and_ctrl_c_ends_the_wait():
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"http://127.0.0.1:{server.getsockname()[1]}/"
        threading.Thread(target=torn_camera, args=(server,), daemon=True).start()
        program = (
            "import slipbound, threading, signal, os\n"
            "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
            "threading.Timer(1, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
            f"try:\n    slipbound.watch({address!r})\n"
            "except KeyboardInterrupt:\n    print('interrupted')\n"
        )
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=20)
        assert done.stdout.strip() == "interrupted", done.stderr
        threading.Thread(target=torn_camera, args=(server,), daemon=True).start()
        with pytest.raises(slipbound.SourceError, match="expected a whole frame within 5 s, got [0-9]+ torn ones"):
            slipbound.watch(address)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="pipes are read by ffmpeg")
def test_ctrl_c_ends_the_wait_for_a_pipe_that_nobody_writes(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    done = interrupted(
        "import slipbound, threading, signal, os\n"
        "threading.Timer(1, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        "try:\n    print('ready')\n"
        f"    slipbound.watch({str(tmp_path / 'pipe')!r})\n"
        "except KeyboardInterrupt:\n    print('interrupted')\n"
    )
    assert done.stdout.strip() == "interrupted", done.stderr


def test_monitors_leave_no_memory_behind():
    # `SLIPBOUND_MONITORS=10000`, as in `.ci/run full`, takes two minutes.
    count = int(os.environ.get("SLIPBOUND_MONITORS", "2000"))
    resource = pytest.importorskip("resource")
    del resource
    # A small finger: the result does not depend on its size.
    sensor = slipbound.Sensor.from_toml(
        'name = "small"\nimage_px = [96, 96]\nflip = "none"\ngrey_weights_rgb = [0.3, 0.4, 0.3]\n'
        'polarity = "dark"\npitch_px = 12.0\nmarker_diameter_px = 4.0\nskin = "smooth"\n'
    )
    image = np.full((96, 96, 3), 150, np.uint8)
    for y in range(6, 96, 12):
        for x in range(6, 96, 12):
            image[y - 2 : y + 2, x - 2 : x + 2] = 60

    def resident_kb() -> int:
        with open("/proc/self/status") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))

    def make(count: int) -> None:
        for _ in range(count):
            report = slipbound.Monitor(sensor, rest=image).step(image)
            assert report.field.now_px.shape[1] == 2 and report.contact.area_px2 == 0

    make(500)
    before_kb = resident_kb()
    make(count)
    grown_kb = resident_kb() - before_kb
    print(f"{count} monitors: {grown_kb:+} kB")
    assert grown_kb < 700 + 0.4 * count
