"""Judges the labelled lifts again with other pictures of them: darker, noisier, smaller, mirrored, at half the rate ...

    python3 bench/real/altered_lifts.py PROGRAM

Clips come from the folder SLIPBOUND_DATA, or ../shared/data beside the project; without them one line says so. Prints a
table: of how many clips the verdict is wrong, and the AUC, with the shipped constants and with the scales fitted to the
other objects (`--refit`). Nothing is asserted: it shows how far a verdict depends on the picture.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

PROJECT = Path(__file__).resolve().parents[2]
RNG = np.random.default_rng(1)

#: Name, what happens to a picture, JPEG quality.
PICTURES = [
    ("encoded once more, JPEG quality 95", lambda picture: picture, 95),
    ("0.7 of the light", lambda picture: 0.7 * picture, 92),
    ("1.2 of the light, the brightest parts clipped", lambda picture: 1.2 * picture, 92),
    ("gamma 0.8", lambda picture: 255 * (picture / 255.0) ** 0.8, 92),
    ("noise of 4 levels", lambda picture: picture + RNG.normal(0, 4, picture.shape), 95),
    ("blurred, sigma 1 px", lambda picture: cv2.GaussianBlur(picture, (0, 0), 1.0), 92),
    ("JPEG quality 60", lambda picture: picture, 60),
    ("three quarters of the size", lambda picture: cv2.resize(picture, None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA), 95),
    ("mirrored", lambda picture: picture[:, ::-1], 95),
    ("turned by 180 degrees", lambda picture: picture[::-1, ::-1], 95),
]

#: Name, which frames are kept.
FRAMES = [
    ("every second frame", lambda frames: frames[::2]),
    ("without the first four frames", lambda frames: frames[4:]),
]


def judged(program, data, refit):
    """Wrong verdicts, clips, AUC."""
    with tempfile.TemporaryDirectory() as out:
        command = [program, "eval", "lifts", "--detector", "ours", "--pictures", "0", "--data", data, "-o", f"{out}/eval"]
        subprocess.run(command + ["--refit"] * refit, check=True, capture_output=True)
        trials = [json.loads(line) for line in open(f"{out}/eval/trials.jsonl")]
        table = Path(f"{out}/eval/table.md").read_text()
    wrong = sum(trial["truth"] != trial["verdict"] for trial in trials)
    auc = next(line for line in table.splitlines() if line.startswith("| ours |")).split("|")[-2].split()[0]
    return f"{wrong} of {len(trials)}, {auc}"


def main():
    program = Path(sys.argv[1]).resolve()
    named = os.environ.get("SLIPBOUND_DATA")
    lifts = (Path(named) if named else PROJECT.parent / "shared" / "data") / "gelsight-lift"
    if not lifts.is_dir():
        print(f"{lifts}: not there: the altered lifts are left out")
        return
    clips = sorted(path for path in lifts.iterdir() if path.is_dir())
    print("| pictures | wrong, AUC | each object left out |\n|---|---|---|")
    for name, alter, quality, keep in [(*p, lambda f: f) for p in PICTURES] + [(n, None, 0, k) for n, k in FRAMES]:
        with tempfile.TemporaryDirectory() as data:
            shutil.copy(lifts / "labels.csv", data)
            for clip in clips:
                (Path(data) / clip.name).mkdir()
                for number, path in enumerate(keep(sorted(clip.glob("*.jpg")))):
                    to = f"{data}/{clip.name}/{number:03d}.jpg"
                    if alter is None:
                        shutil.copy(path, to)
                        continue
                    picture = np.clip(np.rint(alter(cv2.imread(str(path)))), 0, 255).astype(np.uint8)
                    cv2.imwrite(to, picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
            results = [judged(program, data, refit) for refit in (False, True)]
        print(f"| {name} | {results[0]} | {results[1]} |", flush=True)


if __name__ == "__main__":
    main()
