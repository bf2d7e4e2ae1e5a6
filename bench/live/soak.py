"""Whether memory stays flat: a simulated hand is held on two live cameras, recorded, and the memory of both programs is looked at.

    python3 bench/live/soak.py [path of the program slipbound] [seconds]

Linux only (/proc). The largest resident memory of the last third may be 10 % and 4 MB above that of the second: what is
needed once is there after the first.
"""

import subprocess
import signal
import sys
import tempfile
import time
from pathlib import Path

PROGRAM = str(Path(sys.argv[1] if len(sys.argv) > 1 else "target/release/slipbound").resolve())
SECONDS = float(sys.argv[2]) if len(sys.argv) > 2 else 180


def resident_kb(process):
    for line in Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    return 0


def flat(name, samples):
    third = len(samples) // 3
    before, after = max(samples[third : 2 * third]), max(samples[2 * third :])
    print(f"{name}: {len(samples)} samples, at most {before} kB in the second third, {after} kB in the last")
    return after <= 1.1 * before + 4096


with tempfile.TemporaryDirectory() as folder:
    hand = subprocess.Popen(
        [PROGRAM, "emulate", "hand", "--task", "lift", "-o", "hand"],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )
    places = dict(hand.stdout.readline().strip().split(": ", 1) for _ in range(4))
    hold = subprocess.Popen(
        [PROGRAM, "hold", places["left"], places["right"], "--hand", "hand/hand.toml", "--gripper", places["gripper"],
         "--rest", "live:20", "--record=run.mcap", "-o", "run"],
        cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )
    ours, theirs = [], []
    until = time.monotonic() + SECONDS
    while time.monotonic() < until and hold.poll() is None:
        time.sleep(1)
        ours.append(resident_kb(hold))
        theirs.append(resident_kb(hand))
    assert hold.poll() is None, f"hold ended by itself: {hold.returncode}"
    hold.send_signal(signal.SIGINT)
    print(f"hold: exit code {hold.wait()}, recording of {(Path(folder) / 'run.mcap').stat().st_size >> 20} MB")
    hand.send_signal(signal.SIGINT)
    hand.communicate()
    sys.exit(0 if flat("hold", ours) and flat("emulate hand", theirs) else 1)
