"""Calibrates the GelSlim 3.0 finger from its picture at rest and looks for the ball in every picture of a press.

Run from anywhere:  python3 bench/real/check_gelslim3.py
Pictures come from the folder SLIPBOUND_DATA, or ../shared/data beside the project; without them one line says so.
Needs the standard library only. What must hold, with the figures:
  - residual of the grid at most 0.05 pitch RMS, 245 to 265 markers, no node twice;
  - sensors/gelslim3.toml is what the command makes (numbers to 1e-6, words apart);
  - every picture of a press has a contact region whose centre lies within 10 px of the ball as marked by eye in
    gelslim3_balls.csv, and the picture at rest has none.
Exit code 1 on a failure.
"""

import csv
import math
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
RESIDUAL_PITCH, MARKERS, CENTRE_PX = 0.05, (245, 265), 10.0


def same(a, b):
    """Whether two facts agree: numbers to 1e-6, the rest exactly."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a if k not in ("description", "name"))
    if isinstance(a, list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, float):
        return math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-6)
    return a == b


def main():
    named = os.environ.get("SLIPBOUND_DATA")
    folder = (Path(named) if named else PROJECT.parent / "shared" / "data") / "gelslim3-press"
    if not folder.is_dir():
        print("gelslim3-press: SKIPPED, no SLIPBOUND_DATA and no ../shared/data")
        return 0
    run = lambda *words: subprocess.run([str(w) for w in words], cwd=PROJECT, capture_output=True, text=True)
    cargo = ["cargo", "run", "--quiet", "--release", "--locked"]
    failures = 0

    def judge(good, line):
        nonlocal failures
        failures += not good
        print(("pass  " if good else "FAIL  ") + line)

    with tempfile.TemporaryDirectory() as out:
        made = Path(out) / "gelslim3.toml"
        said = run(*cargo, "--", "calibrate", folder / "ref.jpg", "-o", made)
        if said.returncode != 0:
            sys.exit(f"calibrate: exit code {said.returncode}: {said.stderr.strip()}")
        count = int(re.search(r"(\d+) dark markers", said.stdout)[1])
        residual = float(re.search(r"residual ([\d.]+) pitch", said.stdout)[1])
        judge(MARKERS[0] <= count <= MARKERS[1], f"markers {count}, expected {MARKERS[0]} to {MARKERS[1]}")
        judge(residual <= RESIDUAL_PITCH, f"residual {residual} pitch RMS, at most {RESIDUAL_PITCH}")
        ours = tomllib.loads((PROJECT / "sensors" / "gelslim3.toml").read_text())
        judge(same(tomllib.loads(made.read_text()), ours), "sensors/gelslim3.toml is what the command makes")

    rows = [r for r in (PROJECT / "bench/real/gelslim3_balls.csv").read_text().splitlines() if not r.startswith("#")]
    balls = {row["file"]: (float(row["x_px"]), float(row["y_px"])) for row in csv.DictReader(rows)}
    pictures = [folder / name for name in balls]
    judge(sorted(balls) == sorted(p.name for p in folder.glob("sample_*.jpg")), f"{len(balls)} pictures marked, all there are")
    built = os.environ.get("SLIPBOUND_EXAMPLES")
    centre = [Path(built) / "contact_centre"] if built else [*cargo, "-p", "slipbound-rig", "--example", "contact_centre", "--"]
    said = run(*centre, "gelslim3", folder / "ref.jpg",
               folder / "ref.jpg", *pictures)
    if said.returncode != 0:
        sys.exit(f"contact_centre: exit code {said.returncode}: {said.stderr.strip()}")
    markers, rest, *lines = said.stdout.splitlines()
    count = int(markers.split()[1])
    judge(MARKERS[0] <= count <= MARKERS[1], f"markers the monitor keeps {count}, expected {MARKERS[0]} to {MARKERS[1]}")
    judge(rest.endswith(" 0 - -"), "no contact in the picture at rest")
    misses = []
    for name, line in zip(balls, lines):
        _, _, x, y = line.rsplit(" ", 3)
        miss = math.inf if x == "-" else math.dist(balls[name], (float(x), float(y)))
        misses.append(miss)
        if miss > CENTRE_PX:
            print(f"      {name}: centre {x} {y}, ball {balls[name]}")
    near = sum(m <= CENTRE_PX for m in misses)
    misses.sort()
    judge(near == len(balls), f"{near} of {len(balls)} regions centred within {CENTRE_PX} px of the ball: "
                              f"median {misses[len(misses) // 2]:.1f}, worst {misses[-1]:.1f} px")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
