"""Runs every command of the pages that say so, as a reader would.

    python3 docs/check_commands.py target/release/slipbound [page.md ...]

Each page below has a folder of its own. Blocks fenced as ```sh are run in their order by `bash -e`, with the program on the PATH; what
they print is shown when one fails. So does a `slipbound demo` that misses one of its targets, unless a --fault is simulated. A block fenced as ```python runs before the next block of the page. Blocks fenced as ```console are
commands of an installation: each line of theirs has to stand in one of the scripts RUN_BY, which run it.

Of the README and the pages that are not run, because they need a camera, a gripper or hours, every line that begins with `slipbound` (or
`$ slipbound`) is given to the program with `--help` behind it: it refuses a command, an option or a value that it does not know.
"""

import os
import re
import shlex
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
"""Pages whose commands are not run."""
COMMAND = re.compile(r"^(?:    )?(?:\$ )?(slipbound .*)$", re.M)
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
    demos = [run for run in runs if run.startswith("slipbound demo") and "--fault" not in run.splitlines()[0]]
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


def refused(page: str, path: str) -> list[str]:
    """The lines of a page that are not run and that the program would not take."""
    failed, seen = [], 0
    for fenced, indented in FENCED_OR_INDENTED.findall((DOCS / page).read_text()):
        for line in COMMAND.findall(fenced or indented):
            done = subprocess.run([*words(line), "--help"], env={**os.environ, "PATH": path}, capture_output=True, text=True)
            seen += 1
            if done.returncode != 0:
                failed.append(f"{page}: {line}: {done.stderr.strip().splitlines()[0]}")
    print(f"{page}: {seen} commands, each known to the program", flush=True)
    return failed


def main() -> None:
    program, *pages = sys.argv[1:]
    path = f"{Path(program).resolve().parent}:{os.environ['PATH']}"
    failed = []
    for page in pages or PAGES:
        with tempfile.TemporaryDirectory() as folder:
            failed += run(page, folder, path)
    for page in [] if pages else ELSEWHERE:
        failed += refused(page, path)
    for line in failed:
        print(line)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
