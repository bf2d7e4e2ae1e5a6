"""Does to `slipbound watch` and `calibrate` what goes wrong in a laboratory and tells what they say: docs/bad-input.md.

Run from anywhere:  python3 bench/bad_input.py            # prints the table
                    python3 bench/bad_input.py --write    # and puts it into docs/bad-input.md
Needs the standard library only, and `ffmpeg` for the one row of a codec that is not Motion-JPEG. SLIPBOUND_BINARY
names a built command to use instead of `cargo build`. Everything is made from testdata/ in a temporary folder. After
every command that wrote a report, each of its lines is parsed again.
"""

import argparse
import json
import os
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
SIZE = (427, 320)
ME = "--sensor painted.toml --json report.jsonl"

HEAD = f"""# What happens with bad input

Exit codes: 0 done; 1 failed while running, interrupted, or no frame could be judged; 2 invalid request (arguments, sensor or
settings file, nothing to read); 3 finished, but frames were torn or of
another size. A partial report is kept, and all its lines are complete.
Without a usable rest frame there is no report.

Made by `python3 bench/bad_input.py --write`, which prepares each case from `testdata/` in a temporary folder, runs
the command and parses its report line by line (a header, then one line per frame; the complete recording has 48). The
second column omits `slipbound watch`, and `...` stands for `{ME}`.
Under "Calibrating" the last column states whether a sensor file was written.
Messages go to standard error; text in italics is from the closing summary on standard output, which repeats the first
torn frame.
"""

TAIL = """
## What is not detected

- A JPEG with changed bits, or without a few dozen bytes, can still be a valid JPEG: there is no checksum. It is judged as it decodes,
  and its false edges can cause a false slip, also in other frames when it is averaged into the rest frame. (One of which more is missing is torn, even
  if its end marker is there; of 429 real frames each without 400 bytes all were refused, without 64 bytes 86 %.)
- A finger of another kind whose markers happen to have the pitch of the sensor file.
- Calibrating, a wrong `--polarity`: between dark dots there is a grid of bright gaps. Without `--polarity` the stronger grid
  is found.
- Calibrating, a single photo in which something touches: of a recording the calm frames are chosen, a photo is assumed to be
  untouched.
- A frame that is missing or duplicated in an image folder: images carry no number or time of their own.

## Random input

`SLIPBOUND_NOISE_CASES=3000000 cargo test --locked -p slipbound-rig --test hostile_bytes`: 3,000,000 images, 300,000 settings files and
100,000 rest files (`slipbound tare`) with changed bytes, in 212 s on a busy machine, 76 s of a core: each gave an answer or an error,
none a panic.
"""


# ---- things to break

def huge():
    """A PNG that is nothing but a header, of 10.8 GB if it were true."""
    head = b"IHDR" + struct.pack(">IIBBBBB", 60000, 60000, 8, 2, 0, 0, 0)
    chunks = [struct.pack(">I", len(head) - 4) + head + struct.pack(">I", zlib.crc32(head)),
              struct.pack(">I", 0) + b"IDAT" + struct.pack(">I", zlib.crc32(b"IDAT"))]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def jpegs():
    """The pictures of testdata/twist.avi."""
    data, at, found = (PROJECT / "testdata" / "twist.avi").read_bytes(), 0, []
    while (at := data.find(b"00dc", at)) >= 0:
        length = struct.unpack("<I", data[at + 4:at + 8])[0]
        if data[at + 8:at + 10] == b"\xff\xd8":
            found.append(data[at + 8:at + 8 + length])
        at += 8
    return found


def png_of(width, height, rows, colour):
    """A PNG of rows of bytes."""
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    header = struct.pack(">IIBBBBB", width, height, 8, 2 if colour else 0, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
            + chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row for row in rows))) + chunk(b"IEND", b""))


def png(width, height, level, colour=True):
    """An even PNG."""
    return png_of(width, height, [bytes([level]) * (width * (3 if colour else 1))] * height, colour)


def dots(places, radius=4):
    """A grey PNG with a dark dot at each place."""
    width, height = SIZE
    rows = [bytearray([150]) * width for _ in range(height)]
    for x, y in places:
        for row in range(max(0, y - radius), min(height, y + radius + 1)):
            half = int((radius ** 2 - (row - y) ** 2) ** 0.5)
            left, right = max(0, x - half), min(width, x + half + 1)
            rows[row][left:right] = bytes([70]) * (right - left)
    return png_of(width, height, rows, False)


def grid(columns, rows, pitch):
    """Places of dots on a grid."""
    return [(30 + pitch * i, 30 + pitch * j) for i in range(columns) for j in range(rows)]


def cloud(count):
    """A picture of dots on no grid."""
    chance = random.Random(5)
    return dots([(chance.randrange(SIZE[0]), chance.randrange(SIZE[1])) for _ in range(count)])


class Case:
    """A fresh folder with a whole recording in it: twist.avi, run/00.jpg ..., painted.toml."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "run").mkdir()
        for i, jpeg in enumerate(jpegs()):
            self.put(f"run/{i:02}.jpg", jpeg)
        for name in ("twist.avi", "painted.toml"):
            shutil.copy(PROJECT / "testdata" / name, folder)

    def put(self, name, content):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)

    def get(self, name):
        return (self.folder / name).read_bytes()

    def cut(self, name, count):
        whole = self.get(name)
        self.put(name, whole[:count if count > 1 else int(len(whole) * count)])

    def only(self, *frames):
        """A folder run/ with just these pictures."""
        shutil.rmtree(self.folder / "run")
        (self.folder / "run").mkdir()
        for i, frame in enumerate(frames):
            self.put(f"run/{i:02}.png", frame)

    def repeat(self, count):
        for i in range(count):
            shutil.copy(self.folder / f"run/{i % 20:02}.jpg", self.folder / f"run/9{i:04}.jpg")

    def sensor(self, text):
        self.put("mine.toml", 'extends = "painted.toml"\n' + text)

    def mpeg4(self):
        command = "ffmpeg -v error -i twist.avi -c:v mpeg4 -bitexact clip.avi"
        subprocess.run(command.split(), cwd=self.folder, check=True)


def cases():
    """Title, preparation, arguments of `slipbound` (a shell line)."""
    black, white = png(*SIZE, 0), png(*SIZE, 255)
    me, out = ME, "-o finger.toml"
    return [
        ("Recordings", None, None),
        ("nothing there", None, f"nowhere.avi {me}"),
        ("an empty folder", lambda c: c.only(), f"run {me}"),
        ("a folder without pictures", lambda c: (c.only(), c.put("run/notes.txt", "x")), f"run {me}"),
        ("a pattern that matches nothing", None, f"'run/*.png' {me}"),
        ("a fault in the pattern", None, f"'run/[0.jpg' {me}"),
        ("a name longer than the system takes", None, f"{'long' * 80}.avi {me}"),
        ("a path of 4200 signs", None, f"{'a/' * 2100}x.avi {me}"),
        ("AVI cut in its header", lambda c: c.cut("twist.avi", 100), f"twist.avi {me}"),
        ("AVI cut after 8 bytes", lambda c: c.cut("twist.avi", 8), f"twist.avi {me}"),
        ("AVI cut between header and frames", lambda c: c.cut("twist.avi", 240), f"twist.avi {me}"),
        ("AVI cut in its first frame", lambda c: c.cut("twist.avi", 9000), f"twist.avi {me}"),
        ("AVI cut at half", lambda c: c.cut("twist.avi", 0.5), f"twist.avi {me}"),
        ("AVI cut between two frames", lambda c: c.cut("twist.avi", c.get("twist.avi").rfind(b"00dc", 0, 500000)),
         f"twist.avi {me}"),
        ("AVI cut three bytes before its index ends", lambda c: c.put("twist.avi", c.get("twist.avi")[:-3]),
         f"twist.avi {me}"),
        ("AVI cut to zero bytes", lambda c: c.put("twist.avi", b""), f"twist.avi {me}"),
        ("MPEG-4 AVI, whole", lambda c: c.mpeg4(), f"clip.avi {me}"),
        ("MPEG-4 AVI cut at half", lambda c: (c.mpeg4(), c.cut("clip.avi", 0.5)), f"clip.avi {me}"),
        ("MPEG-4 AVI cut in its header", lambda c: (c.mpeg4(), c.cut("clip.avi", 200)), f"clip.avi {me}"),
        ("MPEG-4 AVI, no ffmpeg installed", lambda c: c.mpeg4(), f"clip.avi {me} # PATH="),
        ("a text file named .avi", lambda c: c.put("notes.avi", "day one\n" * 9), f"notes.avi {me}"),
        ("a text file named .avi, no ffmpeg", lambda c: c.put("notes.avi", "day one\n" * 9),
         f"notes.avi {me} # PATH="),
        ("a zero-byte JPEG in the middle", lambda c: c.put("run/07.jpg", b""), f"run {me}"),
        ("a JPEG cut at half", lambda c: c.cut("run/07.jpg", 0.5), f"run {me}"),
        ("a JPEG without 400 of its bytes, as where a camera lost a packet",
         lambda c: c.put("run/07.jpg", (w := c.get("run/07.jpg"))[:9000] + w[9400:]), f"run {me}"),
        ("a JPEG with 200 bytes of noise in it",
         lambda c: c.put("run/07.jpg", (w := c.get("run/07.jpg"))[:9000] + bytes(range(1, 201)) + w[9200:]),
         f"run {me}"),
        ("a JPEG of half the size among the others", lambda c: c.put("run/07.jpg", png(213, 160, 128)), f"run {me}"),
        ("a PNG cut at half", lambda c: c.put("run/07.jpg", black[:len(black) // 2]), f"run {me}"),
        ("a PNG whose header says 60000 x 60000 pixels", lambda c: c.put("run/07.jpg", huge()), f"run {me}"),
        ("a text file named .jpg in the middle", lambda c: c.put("run/07.jpg", "day one\n"), f"run {me}"),
        ("a text file named .jpg alone", lambda c: c.put("notes.jpg", "day one\n"), f"notes.jpg {me}"),
        ("a folder named .jpg among them", lambda c: (c.folder / "run" / "07b.jpg").mkdir(), f"run {me}"),
        ("every picture torn", lambda c: c.only(b"", b"", b""), f"run {me}"),
        ("a black frame in the middle", lambda c: c.put("run/07.jpg", black), f"run {me}"),
        ("the first frame black", lambda c: c.put("run/00.jpg", black), f"run {me}"),
        ("a white frame in the middle", lambda c: c.put("run/07.jpg", white), f"run {me}"),
        ("all frames black", lambda c: c.only(black, black, black), f"run {me}"),
        ("all frames white", lambda c: c.only(white, white, white), f"run {me}"),
        ("an even grey recording, no marker", lambda c: c.only(*[png(*SIZE, 128, False)] * 3), f"run {me}"),
        ("a picture of one pixel", lambda c: c.put("dot.png", png(1, 1, 128)), f"dot.png {me}"),
        ("one single picture", None, f"run/00.jpg {me}"),
        ("a recording with 4 markers", lambda c: c.sensor("[rectification]\nhomography = [[1,0,0],[0,1,0],[0,0,1]]\n"
                                                          "crop_px = [200, 150, 240, 190]\n"),
         "run --sensor mine.toml --json report.jsonl"),
        ("The finger", None, None),
        ("no --sensor, 320x240", lambda c: c.only(png(320, 240, 128)), "run --json report.jsonl"),
        ("no --sensor, a size nobody has", lambda c: c.only(png(100, 100, 128)), "run --json report.jsonl"),
        ("no --sensor, 427x320", None, "run --json report.jsonl"),
        ("no --sensor, one finger has the size", lambda c: c.only(png(640, 480, 128)), "run --json report.jsonl"),
        ("a finger of another size", None, "run --sensor gelsight --json report.jsonl"),
        ("a finger of the right size, but wrong", lambda c: c.sensor("pitch_px = 44.0\nmarker_diameter_px = 20.0\n"),
         "run --sensor mine.toml --json report.jsonl"),
        ("a name nobody has", None, "run --sensor gelslin --json report.jsonl"),
        ("a sensor file that is not there", None, "run --sensor none.toml --json report.jsonl"),
        ("a typo in a key", lambda c: c.sensor("pich_px = 30\n"), "run --sensor mine.toml"),
        ("a wrong type", lambda c: c.sensor('pitch_px = "20"\n'), "run --sensor mine.toml"),
        ("a number that is none", lambda c: c.sensor("pitch_px = nan\n"), "run --sensor mine.toml"),
        ("a length below zero", lambda c: c.sensor("marker_diameter_px = -7\n"), "run --sensor mine.toml"),
        ("a word nobody knows", lambda c: c.sensor('skin = "silk"\n'), "run --sensor mine.toml"),
        ("not TOML", lambda c: c.sensor("pitch_px 20\n"), "run --sensor mine.toml"),
        ("a key twice", lambda c: c.sensor("pitch_px = 20.0\npitch_px = 21.0\n"), "run --sensor mine.toml"),
        ("`extends` in a circle", lambda c: (c.put("a.toml", 'extends = "b.toml"\n'),
                                             c.put("b.toml", 'extends = "a.toml"\n')), "run --sensor a.toml"),
        ("`extends` a file that is not there", lambda c: c.put("a.toml", 'extends = "b.toml"\n'),
         "run --sensor a.toml"),
        ("a key left out", lambda c: c.put("a.toml", 'name = "a"\n'), "run --sensor a.toml"),
        ("a homography that folds the picture", lambda c: c.sensor(
            "[rectification]\nhomography = [[1,0,0],[1,0,0],[0,0,1]]\ncrop_px = [0, 0, 427, 320]\n"),
         "run --sensor mine.toml"),
        ("not text", lambda c: c.put("mine.toml", b"\xff\xfe\0\1"), "run --sensor mine.toml"),
        ("a picture given as sensor", None, "run --sensor run/00.jpg"),
        ("2 MB of comments", lambda c: c.put("mine.toml", "# none\n" * 300000), "run --sensor mine.toml"),
        ("a device that never ends, named .toml", lambda c: (c.folder / "mine.toml").symlink_to("/dev/zero"),
         "run --sensor mine.toml"),
        ("Settings", None, None),
        ("a threshold below zero", lambda c: c.put("s.toml", "[slip]\nthreshold_pitch = -1.0\n"),
         f"run {me} --settings s.toml"),
        ("a threshold that is no number", lambda c: c.put("s.toml", "[slip]\nthreshold_pitch = nan\n"),
         f"run {me} --settings s.toml"),
        ("an unknown key", lambda c: c.put("s.toml", "[slip]\nthreshold_pich = 0.2\n"), f"run {me} --settings s.toml"),
        ("an unknown table", lambda c: c.put("s.toml", "[slipp]\n"), f"run {me} --settings s.toml"),
        ("out of range", lambda c: c.put("s.toml", "[rest]\nwindow_count = 0\n"), f"run {me} --settings s.toml"),
        ("a whole number expected", lambda c: c.put("s.toml", "[rest]\nwindow_count = 2.5\n"),
         f"run {me} --settings s.toml"),
        ("no such file", None, f"run {me} --settings none.toml"),
        ("a word that is no file", None, f"run {me} --settings papr"),
        ("Rest", None, None),
        ("frames beyond the end", None, f"run {me} --rest 30..90"),
        ("backwards", None, f"run {me} --rest 9..3"),
        ("half a range", None, f"run {me} --rest 3.."),
        ("no such picture", None, f"run {me} --rest none.png"),
        ("a dark frame among them", lambda c: c.put("run/02.jpg", black), f"run {me} --rest 0..5"),
        ("only a dark frame", lambda c: c.put("run/02.jpg", black), f"run {me} --rest 2..3"),
        ("a dark picture", lambda c: c.put("dark.png", black), f"run {me} --rest dark.png"),
        ("a torn frame among them", lambda c: c.put("run/02.jpg", b""), f"run {me} --rest 0..5"),
        ("a torn picture", lambda c: c.put("torn.jpg", b""), f"run {me} --rest torn.jpg"),
        ("a picture of another size", lambda c: c.put("other.png", png(320, 240, 128)), f"run {me} --rest other.png"),
        ("a folder", None, f"run {me} --rest run"),
        ("frames of standard input", None, f"- {me} --rest 0..5"),
        ("Outputs", None, None),
        ("--json into no folder", None, "run --sensor painted.toml --json no/where.jsonl"),
        ("--json is a folder", None, "run --sensor painted.toml --json run"),
        ("--json onto the source", None, "twist.avi --sensor painted.toml --json twist.avi"),
        ("--json onto a frame of the source", None, "run --sensor painted.toml --json run/07.jpg --force"),
        ("--json onto a file of somebody else", lambda c: c.put("notes.txt", "mine"),
         "run --sensor painted.toml --json notes.txt"),
        ("a name with escape sequences", None, "$'\\e[31mred' --sensor painted.toml"),
        ("--json onto a full disk", None, "run --sensor painted.toml --json /dev/full"),
        ("--json onto a disk that fills up", None, f"run {me} # FULL"),
        ("--timings into no folder", None, f"run {me} --timings no/where.jsonl"),
        ("--report into no folder", None, f"run {me} --report no/where.html"),
        ("--record into no folder", None, f"run {me} --record no/where.mcap"),
        ("--record of another kind", None, f"run {me} --record run.txt"),
        ("--timings and --json the same", None, "run --sensor painted.toml --json r.jsonl --timings ./r.jsonl"),
        ("--overlay below a file", None, f"run {me} --overlay painted.toml/pictures"),
        ("--overlay is a file", None, f"run {me} --overlay painted.toml"),
        ("--overlay into the source folder", None, f"run {me} --overlay run"),
        ("--overlay onto the source", None, f"twist.avi {me} --overlay twist.avi"),
        ("--overlay video into no folder", None, f"run {me} --overlay no/where.avi"),
        ("--markers without --json", None, "run --sensor painted.toml --markers"),
        ("the reader leaves", None, "run --sensor painted.toml --json - --markers | head -1 | cut -c1-28"),
        ("Ctrl-C in the middle", lambda c: c.repeat(2000), f"run {me} # INT"),
        ("an option nobody knows", None, "run --color red"),
        ("nothing to watch", None, ""),
        ("Calibrating", None, None),
        ("an empty folder", lambda c: c.only(), f"calibrate run {out}"),
        ("a photo without dots", lambda c: c.put("even.png", png(*SIZE, 128)), f"calibrate even.png {out}"),
        ("a black photo", lambda c: c.put("black.png", black), f"calibrate black.png {out}"),
        ("60 dots on no grid", lambda c: c.put("cloud.png", cloud(60)), f"calibrate cloud.png {out}"),
        ("300 dots on no grid", lambda c: c.put("cloud.png", cloud(300)), f"calibrate cloud.png {out}"),
        ("3 by 4 markers", lambda c: c.put("few.png", dots(grid(3, 4, 80))),
         f"calibrate few.png {out}"),
        ("12 by 2 markers", lambda c: c.put("strip.png", dots(grid(12, 2, 30))),
         f"calibrate strip.png {out}"),
        ("half a JPEG", lambda c: c.cut("run/00.jpg", 0.5), f"calibrate run/00.jpg {out}"),
        ("a text file named .jpg", lambda c: c.put("notes.jpg", "day one\n"), f"calibrate notes.jpg {out}"),
        ("frames that are not there", None, f"calibrate run {out} --frames 90..99"),
        ("a pitch of 0", None, f"calibrate run/00.jpg {out} --pitch-mm 0"),
        ("a pitch below zero", None, f"calibrate run/00.jpg {out} --pitch-mm=-1.5"),
        ("a pitch that is no number", None, f"calibrate run/00.jpg {out} --pitch-mm nan"),
        ("a word nobody knows", None, f"calibrate run/00.jpg {out} --skin silk"),
        ("bright markers asked for, dark ones there", None, f"calibrate run/00.jpg {out} --polarity bright"),
        ("no --output", None, "calibrate run/00.jpg"),
        ("--output of another kind", None, "calibrate run/00.jpg -o finger.json"),
        ("--output into no folder", None, "calibrate run/00.jpg -o no/finger.toml"),
        ("--output is a folder", lambda c: (c.folder / "finger.toml").mkdir(), f"calibrate run/00.jpg {out}"),
        ("--output's picture onto the source", lambda c: c.put("finger.png", cloud(60)), f"calibrate finger.png {out}"),
        ("--weight-g without --sensor", None, f"calibrate run {out} --weight-g 200"),
        ("--weight-g on a photo", None, f"calibrate run/00.jpg {out} --sensor painted.toml --weight-g 200"),
        ("--weight-g of no recording", None, f"calibrate none.avi {out} --sensor painted.toml --weight-g 200"),
        ("--weight-g on a recording without a mass", None, f"calibrate run {out} --sensor painted.toml --weight-g 200"),
        ("--weight-g of 0", None, f"calibrate run {out} --sensor painted.toml --weight-g 0"),
        ("--weight-g that is no number", None, f"calibrate run {out} --sensor painted.toml --weight-g nan"),
        ("--weight-g and no finger", None, f"calibrate run {out} --sensor painted.toml --weight-g 200 --fingers 0"),
    ]


# ---- run and tell

def run(binary, folder, line):
    """Exit code, standard error, standard output, and the report as far as it goes."""
    line, _, how = line.partition(" # ")
    environment = dict(os.environ, LC_ALL="C")
    if how == "PATH=":
        environment["PATH"] = "/nonexistent"
    interrupted = "timeout --preserve-status -s INT 1 " if how == "INT" else ""
    command = line if line.startswith("calibrate ") else f"watch {line}"
    # A limit on the size of a file stands for the disk; without the trap it would end the process.
    full = "trap '' XFSZ; ulimit -f 32; " if how == "FULL" else ""
    shell = f"set -o pipefail; {full}{interrupted}{binary} {command}"
    ended = subprocess.run(["/bin/bash", "-c", shell], cwd=folder, env=environment, capture_output=True, text=True,
                           check=False, timeout=120)
    report = folder / "report.jsonl"
    kept = None
    if report.exists():
        text = report.read_text()
        assert text.endswith("\n"), "the last line is not whole"
        kept = [json.loads(part) for part in text.splitlines()]
    if line.startswith("calibrate ") and (folder / "finger.toml").is_file():
        kept = "written"
    said = [text.strip().replace(f"{Path(folder).resolve()}/", "") for text in (ended.stderr, ended.stdout)]
    return ended.returncode, *said, kept


def row(title, line, code, err, out, kept):
    """A line of the table."""
    said = [part.strip() for part in err.splitlines()]
    said = [part for part in said if part and not part.startswith(("Usage:", "tip:", "For more information"))]
    # The verdict on the frames is not the matter here, only what was not judged.
    unjudged = [part for part in out.splitlines() if "; the first is" in part]
    said += [f"*{part}*" for part in unjudged if part.split(": ", 1)[1] not in err]
    line, _, how = line.partition(" # ")
    notes = {"PATH=": ", `PATH` without ffmpeg", "INT": ", Ctrl-C after 1 s", "FULL": ", 32 kB left"}.get(how, "")
    line = line.replace(ME, "...").strip()
    line = re.sub(r"(long|a/){9,}", r"\1\1\1[..]", line)
    said = re.sub(r"(long|a/){9,}", r"\1\1\1[..]", " ".join(said).replace("slipbound: ", ""))
    if how == "INT":
        said = re.sub(r"\d+ frames", "N frames", said)
        lines = "N + 1 lines"
    else:
        lines = "none" if kept is None else kept if isinstance(kept, str) else f"{len(kept)} lines"
    cells = [title, f"`{line}`{notes}" if line else "(nothing)", said or "none", str(code), lines]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="put the table into docs/bad-input.md")
    arguments = parser.parse_args()
    binary = os.environ.get("SLIPBOUND_BINARY")
    if not binary:
        subprocess.run(["cargo", "build", "--quiet", "--release", "-p", "slipbound-cli"], cwd=PROJECT, check=True)
        binary = Path(os.environ.get("CARGO_TARGET_DIR", PROJECT / "target")) / "release" / "slipbound"
    rows = []
    for title, prepare, line in cases():
        if line is None:
            last = "file" if title == "Calibrating" else "report"
            rows.append(f"\n## {title}\n\n| case | command | message | exit code | {last} |\n|---|---|---|---|---|\n")
            continue
        with tempfile.TemporaryDirectory() as temporary:
            case = Case(Path(temporary))
            if prepare:
                prepare(case)
            rows.append(row(title, line, *run(binary, case.folder, line)))
    text = HEAD + "".join(rows) + TAIL
    if arguments.write:
        (PROJECT / "docs" / "bad-input.md").write_text(text)
    else:
        print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
