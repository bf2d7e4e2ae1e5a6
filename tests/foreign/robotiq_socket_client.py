"""A client of the text protocol at port 63352 of a UR controller with Robotiq's URCap, written from the protocol alone.

`SET POS 255 SPE 255 FOR 128 GTO 1` and an end of line is answered by `ack`, without one; `GET OBJ` by `OBJ 2`.

Written: ACT GTO ATR ADR POS SPE FOR. Read besides: STA (0 reset, 1 activating, 3 active), OBJ (0 moving, 1 stopped
while opening, 2 while closing, 3 there), FLT, PRE (the position asked for).
"""

from __future__ import annotations

import socket
import time

RESET, ACTIVATING, ACTIVE = 0, 1, 3
MOVING, STOPPED_OPENING, STOPPED_CLOSING, THERE = 0, 1, 2, 3


class RobotiqSocket:
    """A connection to the controller."""

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.create_connection((host, port), timeout=5.0)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def ask(self, line: str, timeout_s: float = 2.0) -> str:
        """What comes for a line. Answers have no certain end: while one is awaited, what comes at once is it."""
        return self.raw(line, timeout_s).decode("ascii").strip()

    def raw(self, line: str, timeout_s: float = 2.0) -> bytes:
        """The same, byte for byte."""
        self.socket.settimeout(timeout_s)
        self.socket.sendall(line.encode("ascii") + b"\n")
        try:
            data = self.socket.recv(1024)
        except TimeoutError:
            raise TimeoutError(f"{line!r}: no answer for {timeout_s} s") from None
        if not data:
            raise ConnectionError(f"{line!r}: the controller closed the connection")
        return data

    def set(self, **values: int) -> str:
        """Several variables by one SET, in this order."""
        return self.ask("SET " + " ".join(f"{name} {value}" for name, value in values.items()))

    def get(self, name: str) -> int:
        words = self.ask(f"GET {name}").split()
        if len(words) != 2 or words[0] != name:
            raise ValueError(f"GET {name}: answered by {words}")
        return int(words[1], 0)

    def wait(self, name: str, *wanted: int, timeout_s: float = 8.0) -> int:
        """Asks until a variable has one of these values."""
        end = time.monotonic() + timeout_s
        while (value := self.get(name)) not in wanted:
            if time.monotonic() > end:
                raise TimeoutError(f"{name} is {value} after {timeout_s} s, expected {wanted}")
            time.sleep(0.01)
        return value

    def activate(self) -> None:
        """From reset, to where it may move."""
        self.set(ACT=0, ATR=0)
        self.wait("STA", RESET)
        self.set(ACT=1)
        self.wait("STA", ACTIVE)

    def go(self, position: int, speed: int = 255, force: int = 128) -> int:
        """Moves, and says how it stopped."""
        if (answer := self.set(POS=position, SPE=speed, FOR=force, GTO=1)) != "ack":
            raise ValueError(f"SET was answered by {answer!r}")
        self.wait("PRE", position)
        return self.wait("OBJ", STOPPED_OPENING, STOPPED_CLOSING, THERE)

    def close(self) -> None:
        self.socket.close()
