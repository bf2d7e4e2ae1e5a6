"""What `slipbound watch` takes from a file to its outputs, ms a frame: by kind of recording, and by what is written.

`bench/watch.py PROGRAM` prints the tables; it needs numpy and opencv-python-headless (bench/parity/requirements.txt), and ffmpeg for the last row of the
first. Time of the start is taken off: a frame is (long clip - short clip) / (frames - frames), the median of ROUNDS runs of each, in turn.
"""

import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2

ROUNDS = 7
#: Frames of the short clip, of which the first are the finger at rest.
SHORT_COUNT = 60
#: Simulated cameras: GelSlim has a weave and is resampled, the Mini is smooth; both 640x480, 30 frames/s.
CAMERAS = ["gelslim", "gelsight_mini"]
#: What is written, and the options that ask for it.
OUTPUTS = {
    "nothing": [],
    "--json": ["--json", "{}/run.jsonl"],
    "--json --markers": ["--json", "{}/run.jsonl", "--markers"],
    "--csv": ["--csv", "{}/run.csv"],
    "--overlay FILE.avi": ["--overlay", "{}/seen.avi"],
    "--overlay FOLDER (PNG)": ["--overlay", "{}/seen"],
    "--record": ["--record", "{}/run.mcap"],
}


def run_s(command):
    """Seconds on the clock and of all processors."""
    before, start_s = os.times(), time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    clock_s, after = time.monotonic() - start_s, os.times()
    return clock_s, after.children_user + after.children_system - before.children_user - before.children_system


def frame_ms(program, long, short, frames_count, sensor, output):
    """Medians of the ms that one more frame takes, on the clock and of all processors, and the ms of the step among them."""
    clock_ms, cpu_ms = [], []
    for _ in range(ROUNDS):
        times = []
        for source in (short, long):
            with tempfile.TemporaryDirectory() as folder:
                options = [option.format(folder) for option in output]
                times.append(run_s([program, "watch", str(source), "--sensor", str(sensor), *options]))
        clock_ms.append(1e3 * (times[1][0] - times[0][0]) / (frames_count - SHORT_COUNT))
        cpu_ms.append(1e3 * (times[1][1] - times[0][1]) / (frames_count - SHORT_COUNT))
    return statistics.median(clock_ms), statistics.median(cpu_ms)


def step_ms(program, source, sensor):
    """Median of the whole step in memory."""
    with tempfile.TemporaryDirectory() as folder:
        timings = Path(folder) / "timings.jsonl"
        run_s([program, "watch", str(source), "--sensor", str(sensor), "--timings", str(timings)])
        rows = [json.loads(line) for line in timings.read_text().splitlines()]
    return statistics.median(row["all_us"] for row in rows[SHORT_COUNT:]) / 1e3


def copies(folder, frames, kind):
    """The frames as another kind of recording."""
    if kind == "PNG folder":
        target = folder / "png"
        target.mkdir()
        for path in frames:
            cv2.imwrite(str(target / f"{path.stem}.png"), cv2.imread(str(path)))
        return target
    if kind == "JPEG folder":
        target = folder / "jpeg"
        target.mkdir()
        for path in frames:
            shutil.copy(path, target)
        return target
    name, codec = {"AVI, Motion JPEG": ("run.avi", ["copy"]), "MP4, H.264, by ffmpeg": ("run.mp4", ["libx264", "-crf", "18"])}[kind]
    listed = folder / "frames.txt"
    listed.write_text("".join(f"file '{path}'\nduration 0.0333333\n" for path in frames))
    command = ["ffmpeg", "-loglevel", "error", "-f", "concat", "-safe", "0", "-i", str(listed), "-c:v", *codec, str(folder / name)]
    subprocess.run(command, check=True)
    return folder / name


def main(program):
    print(f"{os.cpu_count()} cores, load before {os.getloadavg()[0]:.1f}; median of {ROUNDS}\n")
    kinds = ["JPEG folder", "PNG folder"]
    kinds += ["AVI, Motion JPEG", "MP4, H.264, by ffmpeg"] if shutil.which("ffmpeg") else []
    with tempfile.TemporaryDirectory() as folder:
        clips = {}
        for camera in CAMERAS:
            clip = Path(folder) / camera
            scene = f"ramp?object=water_bottle&ramp_s=8&camera={camera}"
            run_s([program, "simulate", scene, "-o", str(clip)])
            clips[camera] = clip, sorted(clip.glob("*.jpg"))
        print("| recording | " + " | ".join(f"{camera}: clock ms | all processors ms | of it the step" for camera in CAMERAS) + " |")
        print("|---" * (1 + 3 * len(CAMERAS)) + "|")
        for kind in kinds:
            cells = []
            for clip, frames in clips.values():
                with tempfile.TemporaryDirectory() as long, tempfile.TemporaryDirectory() as short:
                    sources = copies(Path(long), frames, kind), copies(Path(short), frames[:SHORT_COUNT], kind)
                    clock_ms, cpu_ms = frame_ms(program, *sources, len(frames), clip / "sensor.toml", [])
                    cells.append(f"{clock_ms:.2f} | {cpu_ms:.2f} | {step_ms(program, sources[0], clip / 'sensor.toml'):.2f}")
            print(f"| {kind} | " + " | ".join(cells) + " |", flush=True)
        print("\n| written, from a JPEG folder | " + " | ".join(f"{camera}: clock ms | all processors ms" for camera in CAMERAS) + " |")
        print("|---" * (1 + 2 * len(CAMERAS)) + "|")
        for name, output in OUTPUTS.items():
            cells = []
            for clip, frames in clips.values():
                with tempfile.TemporaryDirectory() as short:
                    sources = clip, copies(Path(short), frames[:SHORT_COUNT], "JPEG folder")
                    clock_ms, cpu_ms = frame_ms(program, *sources, len(frames), clip / "sensor.toml", output)
                    cells.append(f"{clock_ms:.2f} | {cpu_ms:.2f}")
            print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
