"""Runs every command of the pages that say so, as a reader would.

    python3 docs/check_commands.py target/release/slipbound [page.md ...]

Each page below has a folder of its own. Blocks fenced as ```sh are run in their order by `bash -e`, with the program on the PATH; what
they print is shown when one fails. A block fenced as ```python runs before the next block of the page. Blocks fenced as ```console are
commands of an installation: each line of theirs has to stand in one of the scripts RUN_BY, which run it.
"""

import os
import re
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
        command = ["bash", "-ec", block] if kind == "sh" else [sys.executable, "-c", block]
        began = time.monotonic()
        done = subprocess.run(command, cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True)
        print(f"{page}: {block.strip().splitlines()[0]} ... {time.monotonic() - began:.1f} s", flush=True)
        if done.returncode != 0:
            failed.append(f"{page}: exit code {done.returncode}:\n{block}{done.stdout}{done.stderr}")
    return failed


def main() -> None:
    program, *pages = sys.argv[1:]
    path = f"{Path(program).resolve().parent}:{os.environ['PATH']}"
    failed = []
    for page in pages or PAGES:
        with tempfile.TemporaryDirectory() as folder:
            failed += run(page, folder, path)
    for line in failed:
        print(line)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
