"""The whole chain on this computer: cameras, gripper and wrist of a simulated hand at addresses, and `run` or `hold` on them.

    python3 bench/live/chain.py [path of the program slipbound] [runs] [seconds of hold]

For every run: how it ended, in the simulation too; frames judged, skipped, lost; from the arrival of a frame to the record of
the cycle that used it (the command was sent before that), p50, p99, p99.9. Ends with an error when a run did not end as the
same scene does in lock-step.
"""

import json
import re
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from mcap.reader import make_reader

PROGRAM = str(Path(sys.argv[1] if len(sys.argv) > 1 else "target/release/slipbound").resolve())
RUNS = int(sys.argv[2]) if len(sys.argv) > 2 else 1
HOLD_S = sys.argv[3] if len(sys.argv) > 3 else "6"
# Per run: what is done, on which hand, how it must end, and whether the wrist is used.
CHAINS = [
    ("screw", ["run", "screw"], ["--task", "screw", "--set", "mu=0.6"], "Tight"),
    ("hold", ["hold", "--for-s", HOLD_S], ["--task", "lift"], "Held"),
]
LONGEST_S = 120


def served(folder, arguments):
    """The hand and its addresses."""
    command = [PROGRAM, "emulate", "hand", "-o", "hand", *arguments]
    hand = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    places = {}
    while "wrist" not in places:
        line = hand.stdout.readline()
        assert line, f"{command}: {hand.wait()}"
        name, _, place = line.strip().partition(": ")
        places[name] = place
    return hand, places


def latencies_ms(recording):
    """From the arrival of a frame to the record of the first cycle with it."""
    arrived, latencies, fates = {}, [], {}
    with open(recording, "rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            if channel.topic in ("/left/camera", "/right/camera"):
                arrived[channel.topic.split("/")[1], message.sequence] = message.log_time
            elif channel.topic.endswith("/frame"):
                fate = json.loads(message.data)["fate"]
                fates[fate] = fates.get(fate, 0) + 1
            elif channel.topic == "/cycle/frames":
                for name, finger in zip(("left", "right"), json.loads(message.data)["fingers"]):
                    at = arrived.get((name, finger.get("seq")))
                    if finger["next"] == "frame" and at is not None:
                        latencies.append((message.log_time - at) / 1e6)
    return sorted(latencies), fates


def quantile(values, share):
    return values[min(len(values) - 1, int(share * len(values)))] if values else float("nan")


def once(folder, name, command, scene, expected):
    hand, places = served(folder, scene)
    arguments = [*command, places["left"], places["right"], "--hand", "hand/hand.toml", "--gripper", places["gripper"]]
    if name != "hold":
        arguments += ["--wrist", places["wrist"]]
    arguments += ["--rest", "live:20", "--record=run.mcap", "-o", "run"]
    try:
        ran = subprocess.run([PROGRAM, *arguments], cwd=folder, capture_output=True, text=True, timeout=LONGEST_S, check=False)
        code, said = ran.returncode, ran.stdout + ran.stderr
    except subprocess.TimeoutExpired as late:
        code, said = "none", f"not over after {late.timeout} s"
    hand.send_signal(signal.SIGINT)
    world = hand.communicate()[0].strip().splitlines()[-1]
    latencies, fates = latencies_ms(folder / "run.mcap")
    ended = re.search(r"^ *ended +(.*?) *$", said, re.MULTILINE)
    ended = ended.group(1) if ended else said.strip().splitlines()[-1]
    shares = " ".join(f"p{100 * share:g} {quantile(latencies, share):.1f} ms" for share in (0.5, 0.99, 0.999))
    print(f"{name}: exit code {code}, ended {ended}; {len(latencies)} frames used, {fates}; {shares}; world {world}", flush=True)
    return ended == expected


def main():
    right = 0
    for name, command, scene, expected in CHAINS:
        for seed in range(1, RUNS + 1):
            with tempfile.TemporaryDirectory() as folder:
                right += once(Path(folder), name, command, [*scene, "--seed", str(seed)], expected)
    total = RUNS * len(CHAINS)
    print(f"{right} of {total} runs ended as in lock-step")
    sys.exit(0 if right == total else 1)


main()
