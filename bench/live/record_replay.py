"""Record, then judge the recording again: the same lines, to the last byte?

1. Every shared recording (SLIPBOUND_DATA, or ../shared/data beside the project) and five scenes: `watch --record`, then `watch` on that.
2. The same with frames dropped by force: clips and a scene as Motion JPEG over HTTP, in bursts that come faster than frames can be
   judged; judged again are the frames that were judged, and no others.

    python3 bench/live/record_replay.py [path of the program slipbound]
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2
from mcap.reader import make_reader

PROJECT = Path(__file__).resolve().parents[2]
PROGRAM = str(Path(sys.argv[1] if len(sys.argv) > 1 else PROJECT / "target/release/slipbound").resolve())
DATA = Path(os.environ.get("SLIPBOUND_DATA", PROJECT.parent / "shared" / "data"))
SCENES = [
    "sim:press?seed=1&camera=gelsight_mini",
    "sim:shear?seed=2&object=crayons_box",
    "sim:twist?seed=3&surroundings=full",
    "sim:ramp?seed=4&object=screwdriver&fault=drop=0.05,torn=0.03",
    "sim:regrip?seed=5&grid=fast",
]
# Frames of a burst, and the pause behind it.
BURST_COUNT, PAUSE_S = 6, 0.03
# So many of the clips are also streamed, again and again until it is so many frames.
STREAMED_COUNT = 12
LEAST_COUNT = 240


def recordings():
    """Shared recordings, the finger that saw them, and what says how it is at rest."""
    if not DATA.exists():
        print(f"left out: shared recordings (no folder {DATA})")
        return []
    found = [(clip, "gelsight", ()) for clip in sorted((DATA / "gelsight-lift").iterdir()) if clip.is_dir()]
    found += [(clip, "gelsight_mini_wide", ()) for clip in sorted((DATA / "gelsight-mini-press").glob("*.avi"))]
    found += [(clip, "gelsight_mini_near", ()) for clip in sorted((DATA / "gelsight-mini-wriggle").rglob("*.avi"))]
    balls = DATA / "gelslim3-press"
    found.append((balls / "sample_*.jpg", "gelslim3", ("--rest", str(balls / "ref.jpg"))))
    return found


def judged(path):
    """The lines of a report without its header, which names the source."""
    return path.read_text().splitlines()[1:]


def again(folder, sensor, rest):
    command = [PROGRAM, "watch", "run.mcap", "--sensor", sensor, "--markers", "--json", "again.jsonl", *rest]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode in (0, 3), f"{command}: {ran.returncode}: {ran.stderr}"
    return judged(folder / "again.jsonl")


def compare(name, first, second, notes=""):
    same = first == second and len(first) > 0
    if not same:
        at = next((i for i, (a, b) in enumerate(zip(first, second)) if a != b), min(len(first), len(second)))
        print(f"{name}: NOT the same from line {at}: {len(first)} and {len(second)} lines {notes}")
    return same


def as_it_is(source, sensor, rest):
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        command = [PROGRAM, "watch", str(source), "--markers", "--json", "first.jsonl", "--record", "run.mcap", *rest]
        if sensor:
            command += ["--sensor", sensor]
        ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert ran.returncode in (0, 3), f"{command}: {ran.returncode}: {ran.stderr}"
        if not sensor:
            sensor = sensor_of(folder / "run.mcap", folder)
        first = judged(folder / "first.jsonl")
        return len(first), compare(source, first, again(folder, sensor, rest))


def sensor_of(recording, folder):
    """The sensor file that a recording holds."""
    with open(recording, "rb") as file:
        for attachment in make_reader(file).iter_attachments():
            if attachment.name.endswith(".sensor.toml"):
                (folder / attachment.name).write_bytes(attachment.data)
                return attachment.name
    raise AssertionError(f"{recording}: no sensor file")


def pictures(source):
    """The frames of a clip as JPEGs."""
    if source.is_dir():
        return [file.read_bytes() for file in sorted(source.glob("*.jpg"))]
    video, frames = cv2.VideoCapture(str(source)), []
    while (frame := video.read()[1]) is not None:
        frames.append(cv2.imencode(".jpg", frame)[1].tobytes())
    return frames


class Server(ThreadingHTTPServer):
    """Serves JPEGs once, in bursts; then says no more."""

    daemon_threads = True

    def __init__(self, jpegs):
        super().__init__(("127.0.0.1", 0), Stream)
        self.jpegs, self.over = jpegs * -(-LEAST_COUNT // len(jpegs)), threading.Event()
        threading.Thread(target=self.serve_forever, daemon=True).start()


class Stream(BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        try:
            for number, jpeg in enumerate(self.server.jpegs):
                head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                self.wfile.write(head.encode() + jpeg + b"\r\n")
                if number % BURST_COUNT == BURST_COUNT - 1:
                    time.sleep(PAUSE_S)
            self.server.over.set()
            time.sleep(60)
        except OSError:
            pass

    def log_message(self, *_):
        pass


def until_still(path, least_s=2.0, most_s=60.0):
    """Waits until a file grows no more; not for 3 s, after which the program opens a silent stream again."""
    size, since, began = -1, time.monotonic(), time.monotonic()
    while time.monotonic() - since < least_s and time.monotonic() - began < most_s:
        time.sleep(0.05)
        now = path.stat().st_size if path.exists() else -1
        if now != size:
            size, since = now, time.monotonic()


def streamed(source, jpegs, sensor):
    """Frames judged, frames passed over, and whether the recording is judged to the same lines."""
    with tempfile.TemporaryDirectory() as scratch:
        folder, server = Path(scratch), Server(jpegs)
        url = f"http://127.0.0.1:{server.server_port}/stream"
        command = [PROGRAM, "watch", url, "--sensor", sensor, "--markers", "--json", "first.jsonl", "--record", "run.mcap"]
        watch = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        assert server.over.wait(60), f"{source}: not read to the end"
        until_still(folder / "first.jsonl")
        watch.send_signal(signal.SIGINT)
        said = watch.communicate(timeout=60)[1]
        server.shutdown()
        assert watch.returncode in (0, 3), f"{source}: {watch.returncode}: {said}"
        fates = {"judged": 0, "skipped": 0}
        with open(folder / "run.mcap", "rb") as file:
            for _, _, message in make_reader(file).iter_messages(topics=["/finger/frame"]):
                fates[json.loads(message.data)["fate"]] += 1
        first = judged(folder / "first.jsonl")
        same = compare(f"{source}, streamed", first, again(folder, sensor, ()), fates)
        seen = sum(fates.values())
        if seen != len(server.jpegs):
            print(f"{source}, streamed: {len(server.jpegs)} frames sent, {seen} in the recording: {fates}")
        return fates, same and seen == len(server.jpegs)


def main():
    right = total = frames = 0
    found = recordings()
    for source, sensor, rest in found:
        lines, same = as_it_is(source, sensor, rest)
        right, total, frames = right + same, total + 1, frames + lines
    print(f"shared recordings: {right} of {total} the same, {frames} frames")
    good = right == total
    right = frames = 0
    for scene in SCENES:
        lines, same = as_it_is(scene, None, ())
        right, frames = right + same, frames + lines
    print(f"scenes: {right} of {len(SCENES)} the same, {frames} frames")
    good &= right == len(SCENES)
    streams = [(source, pictures(source), sensor) for source, sensor, rest in found[:: max(1, len(found) // STREAMED_COUNT)] if not rest]
    with tempfile.TemporaryDirectory() as scratch:
        subprocess.run([PROGRAM, "simulate", "shear", "--seed", "7", "-o", "scene"], cwd=scratch, check=True, capture_output=True)
        scene = Path(scratch) / "scene"
        streams.append((scene, pictures(scene), str(scene / "sensor.toml")))
        right, fates = 0, {"judged": 0, "skipped": 0}
        for source, jpegs, sensor in streams:
            these, same = streamed(source, jpegs, sensor)
            right += same
            fates = {fate: count + these[fate] for fate, count in fates.items()}
    print(f"streams in bursts: {right} of {len(streams)} the same, {fates['judged']} frames judged, {fates['skipped']} passed over")
    good &= right == len(streams) and fates["skipped"] > 0
    sys.exit(0 if good else 1)


main()
