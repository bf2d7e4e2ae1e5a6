"""Runs the commands of the pages, as a reader would, and asks the program whether it knows those that cannot be run here.

    python3 docs/check_commands.py target/release/slipbound [page.md ...]

Each page below has a folder of its own. Blocks fenced as ```sh are run in their order by `bash -e`, with the program on the PATH; what
they print is shown when one fails. So does a `slipbound demo` that misses one of its targets, unless a --fault is simulated. A block fenced as ```python runs before the next block of the page. Blocks fenced as ```console are
commands of an installation: each line of theirs has to stand in one of the scripts RUN_BY, which run it.

Of the README and the other pages every line that begins with `slipbound` or `slipbound-ros2` (after `$ ` in a transcript) is run too, in
their order, in a folder of the page. A transcript, the program's output below each command, is run as a whole where none of its lines is left
out, and has to print what stands there. Left out are:

- lines that need a camera, a gripper or a file of the reader (NEEDS), and those of slipbound-ros2. They are given to the program with
  `--help` behind them: it refuses a command, an option or a value that it does not know.
- lines that take longer or have no end (LONG). They are begun: what names a scene, an object or a setting that does not exist ends at once.

Commands in the text, in `backquotes`, of all pages are treated as the former. slipbound-ros2 is that of target/debug (`ros2/check.sh`).
"""

import difflib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

DOCS = Path(__file__).resolve().parent
PAGES = [
    "index.md", "install.md", "tutorial.md", "outputs.md", "choosing-a-controller.md", "method.md", "accuracy.md",
    "troubleshooting.md", "faq.md",
]
RUN_BY = [".ci/run", "packaging/build.sh", "packaging/try-deb.sh"]
ELSEWHERE = ["../README.md", *sorted(page.name for page in DOCS.glob("*.md") if page.name not in PAGES)]
"""Pages whose lines are run one by one, as far as that is possible."""
COMMAND = re.compile(r"^(?:    )?(?:\$ )?(slipbound(?:-ros2)? .*)$", re.M)
INLINE = re.compile(r"`(slipbound(?:-ros2)? [^`]*)`")
PROMPT = re.compile(r"^(?:    )?\$ ", re.M)
NEEDS = re.compile(
    r"v4l2:|://(?:\.\.|192\.168|HOST)|\bADDRESS\b|\bclips?[/_]|\b(?:run|recording|left|right)\.avi|\bphoto\.|\b(?:rest|first)\.mcap|^slipbound-ros2"
)
LONG = re.compile(r"^slipbound (?:eval|paper|trials|latency|emulate)\b|--fault lost")
LONG_S = 4.0
"""How long the latter run: they are refused sooner."""
PLACEHOLDER = re.compile(r" \S*(?:\b[A-Z]{4,}\b|\.\.\.)")
"""A word that stands for another, in a command in the text."""
FENCED_OR_INDENTED = re.compile(r"^```(?:sh|text|console)\n(.*?)^```|((?:^    [^\n]*\n)+)", re.M | re.S)
BLOCK = re.compile(r"^```(sh|python|console)\n(.*?)^```", re.M | re.S)


def run(page: str, folder: str, path: str) -> list[str]:
    """What failed on a page."""
    elsewhere = "".join((DOCS.parent / name).read_text() for name in RUN_BY)
    failed = []
    for kind, block in BLOCK.findall((DOCS / page).read_text()):
        if kind == "console":
            missing = [line for line in block.splitlines() if line.strip() and line.split("  #")[0].strip() not in elsewhere]
            failed += [f"{page}: {line}: is run nowhere" for line in missing]
            continue
        command = ["bash", "-exc", block] if kind == "sh" else [sys.executable, "-c", block]
        began = time.monotonic()
        whole = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        done = subprocess.run(command, cwd=folder, env={**os.environ, "PATH": path}, **whole)
        print(f"{page}: {block.strip().splitlines()[0]} ... {time.monotonic() - began:.1f} s", flush=True)
        if done.returncode != 0:
            failed.append(f"{page}: exit code {done.returncode}:\n{block}{done.stdout}")
        failed += [f"{page}: {line}" for line in missed(done.stdout)]
    return failed


def missed(printed: str) -> list[str]:
    """The demos, as `bash -x` names them above what they print, that miss a target although nothing fails."""
    runs = re.split(r"^\++ ", printed, flags=re.M)
    demos = [run for run in runs if run.startswith("slipbound demo") and "-fault " not in run.splitlines()[0]]
    return [run for run in demos if re.search(r": missed$", run, re.M)]


def words(line: str) -> list[str]:
    """A command as a shell takes it, up to the first redirection, pipe, `&` or comment."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars="|&;<>")
    lexer.whitespace_split = True
    lexer.commenters = ""
    taken = []
    for word in lexer:
        if word.startswith("#") or set(word) <= set("|&;<>"):
            break
        taken.append(word)
    return taken


def known(line: str, path: str) -> str | None:
    """Why the program would not take a line."""
    program, *arguments = words(line)
    found = shutil.which(program, path=path)
    if found is None:
        return f"{program} is not there: ros2/check.sh builds it" if program == "slipbound-ros2" else f"no {program}"
    done = subprocess.run([found, *arguments, "--help"], capture_output=True, text=True)
    return done.stderr.strip().splitlines()[0] if done.returncode != 0 else None


def begun(line: str, folder: str, path: str) -> str | None:
    """Why a line that takes long has ended already."""
    whole = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with subprocess.Popen(words(line), cwd=folder, env={**os.environ, "PATH": path}, **whole) as running:
        try:
            printed, _ = running.communicate(timeout=LONG_S)
        except subprocess.TimeoutExpired:
            running.kill()
            return None
    return printed if running.returncode != 0 else None


def ran(line: str, folder: str, path: str) -> str | None:
    """Why a line failed. One with a fault may."""
    done = subprocess.run(["bash", "-exc", line], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True)
    if done.returncode not in (0, 1 if "-fault " in line else 0):
        return f"exit code {done.returncode}: {done.stdout}{done.stderr}"
    return "\n".join(missed(done.stderr.splitlines()[0] + "\n" + done.stdout)) or None


def transcript(block: str, folder: str, path: str) -> str | None:
    """How the output of the commands of a block differs from what stands below them; where nothing does, anything may come."""
    shown: list[tuple[str, list[str]]] = []
    for line in (line.removeprefix("    ") for line in block.splitlines()):
        if line.startswith("$ "):
            shown.append((line.removeprefix("$ "), []))
        elif line.strip():
            shown[-1][1].append(line)
    mark = "-- the next command --"
    # One in the background has to be there for the next.
    script = "".join(f"{line}\n{'sleep 1' if line.endswith('&') else ''}\necho '{mark}'\n" for line, _ in shown)
    whole = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    done = subprocess.run(["bash", "-c", f"trap 'kill $(jobs -p) 2>&-' EXIT\n{script}"], cwd=folder, env={**os.environ, "PATH": path}, **whole)
    printed_of_each = done.stdout.split(f"{mark}\n")
    if len(printed_of_each) != len(shown) + 1:
        return done.stdout
    differ = []
    for (line, expected), printed in zip(shown, printed_of_each):
        if expected and expected != printed.splitlines():
            differ += [line, *difflib.unified_diff(expected, printed.splitlines(), "page", "printed", lineterm="", n=0)]
    return "\n".join(differ) or None


def run_lines(page: str, folder: str, path: str) -> list[str]:
    """The lines and transcripts of a page that failed or that the program would not take."""
    failed, counts = [], {known: 0, begun: 0, ran: 0, transcript: 0}
    began = time.monotonic()

    def check(how, line: str, *arguments: str) -> None:
        counts[how] += 1
        why = how(line, *arguments)
        if why is not None:
            failed.append(f"{page}: {line.strip().splitlines()[0]}: {why}")

    text = (DOCS / page).read_text()
    for fenced, indented in FENCED_OR_INDENTED.findall(text):
        block = fenced or indented
        lines = [line.split("  #")[0].strip() for line in COMMAND.findall(block)]
        if PROMPT.search(block) and lines and not any(NEEDS.search(line) for line in lines):
            check(transcript, block, folder, path)
            continue
        for line in lines:
            if NEEDS.search(line):
                check(known, line, path)
            else:
                check(begun if LONG.search(line) else ran, line, folder, path)
    in_text, inline_count = refused(page, path)
    failed += in_text
    counts[known] += inline_count
    told = f"{counts[ran]} lines and {counts[transcript]} transcripts run, {counts[begun]} begun, {counts[known]} known to the program"
    print(f"{page}: {told} ... {time.monotonic() - began:.1f} s", flush=True)
    if not any(counts.values()) and re.search(r"^\W*slipbound(-ros2)? [a-z]", text, re.M):
        failed.append(f"{page}: none of its commands is looked at")
    return failed


def refused(page: str, path: str) -> tuple[list[str], int]:
    """The commands in the text of a page that the program would not take, up to a word that stands for another; and how many there are."""
    lines = [PLACEHOLDER.split(line)[0] for line in INLINE.findall((DOCS / page).read_text())]
    failed = [(line, known(line, path)) for line in lines]
    # An option that is named without its value is known all the same.
    return [f"{page}: `{line}`: {why}" for line, why in failed if why and "a value is required" not in why], len(lines)


def main() -> None:
    program, *pages = sys.argv[1:]
    release = Path(program).resolve().parent
    path = f"{release}:{release.parent / 'debug'}:{os.environ['PATH']}"
    failed = []
    for page in pages or [*PAGES, *ELSEWHERE]:
        with tempfile.TemporaryDirectory() as folder:
            failed += run(page, folder, path) + refused(page, path)[0] if page in PAGES else run_lines(page, folder, path)
    for line in failed:
        print(line)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
