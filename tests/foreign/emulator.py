"""Starts `slipbound emulate` and says where it listens."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("SLIPBOUND", str(ROOT / "target" / "release" / "slipbound"))
STARTED_WITHIN_S = 10.0


class Emulator:
    """One emulated gripper, from entering the `with` block to leaving it."""

    def __init__(self, name: str, *arguments: str) -> None:
        self.name = name
        # TCP port 0 takes any that is free.
        self.command = [PROGRAM, "emulate", name, *arguments]
        self.last_words = ""

    def __enter__(self) -> Emulator:
        self.process = subprocess.Popen(
            self.command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True
        )
        try:
            self.address = self._first_line().split("://", 1)[1]
        except BaseException:
            self.process.kill()
            self.process.wait()
            raise
        return self

    def _first_line(self) -> str:
        """What it says once it listens: `wsg50://127.0.0.1:4711`, `robotiq:///dev/pts/3`."""
        end = time.monotonic() + STARTED_WITHIN_S
        line = b""
        descriptor = self.process.stdout.fileno()
        while not line.endswith(b"\n"):
            if not select.select([descriptor], [], [], max(0.0, end - time.monotonic()))[0]:
                raise TimeoutError(f"{self.command}: said nothing for {STARTED_WITHIN_S} s")
            byte = os.read(descriptor, 1)
            if not byte:
                raise RuntimeError(f"{self.command}: ended with {self.process.wait()}, said {line!r}")
            line += byte
        return line.decode().strip()

    @property
    def host(self) -> str:
        return self.address.rsplit(":", 1)[0]

    @property
    def port(self) -> int:
        return int(self.address.rsplit(":", 1)[1])

    def end(self) -> str:
        """Ends it, and gives its last words: `at the end: 128.00 N per finger, opening 50.00 mm, the block is held`."""
        if self.process.returncode is not None:
            return self.last_words
        self.process.send_signal(signal.SIGINT)
        try:
            self.last_words = self.process.communicate(timeout=5.0)[0]
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.last_words = self.process.communicate()[0]
        return self.last_words

    def __exit__(self, *_: object) -> None:
        self.end()
