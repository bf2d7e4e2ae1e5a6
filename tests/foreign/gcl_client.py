"""A client of the WSG-50's text interface (GCL), written from the protocol alone.

One command a line. A motion is answered by `ACK X` at once and `FIN X` when it is done; a question `X?` by `X=value`;
what is refused, or fails, by `ERR X code` (with VERBOSE=1 a text follows).
"""

from __future__ import annotations

import re
import time

from tcp_link import TcpLink

NOT_INITIALIZED, ALREADY_RUNNING, NO_PARAM_EXPECTED, NOT_ENOUGH_PARAMS = 3, 4, 12, 13
UNKNOWN_COMMAND, FORMAT, ACCESS_DENIED = 14, 15, 16
FAILED, ABORTED, INVALID_PARAMETER, OUT_OF_RANGE, AXIS_BLOCKED = 18, 19, 24, 28, 29
NAMES = {
    "E_NOT_INITIALIZED": NOT_INITIALIZED,
    "E_ALREADY_RUNNING": ALREADY_RUNNING,
    "E_NO_PARAM_EXPECTED": NO_PARAM_EXPECTED,
    "E_NOT_ENOUGH_PARAMS": NOT_ENOUGH_PARAMS,
    "E_CMD_UNKNOWN": UNKNOWN_COMMAND,
    "E_CMD_FORMAT_ERROR": FORMAT,
    "E_ACCESS_DENIED": ACCESS_DENIED,
    "E_CMD_FAILED": FAILED,
    "E_CMD_ABORTED": ABORTED,
    "E_INVALID_PARAMETER": INVALID_PARAMETER,
    "E_RANGE_ERROR": OUT_OF_RANGE,
    "E_AXIS_BLOCKED": AXIS_BLOCKED,
}

IDLE, GRASPING, NO_PART, PART_LOST, HOLDING, RELEASING, POSITIONING, ERROR = range(8)


class Refused(Exception):
    """`ERR X code`: the line, and its code, whether it came as a number or by its name."""

    def __init__(self, line: str) -> None:
        super().__init__(line)
        self.line = line
        words = line.split()
        self.command = words[1] if len(words) > 1 and words[1].isalpha() else ""
        numbers = [int(word) for word in words if word.isdigit()]
        names = [NAMES[word] for word in words if word in NAMES]
        self.code = next(iter(numbers + names), None)
        self.is_named = bool(names)


class Gcl(TcpLink):
    """A connection to the gripper."""

    def send(self, line: str) -> None:
        self.socket.sendall(line.encode("ascii") + b"\n")

    def line(self, timeout_s: float = 2.0) -> str:
        """The next line, without its end."""
        end = time.monotonic() + timeout_s
        while b"\n" not in self.pending:
            self.more(end, timeout_s)
        line, self.pending = self.pending.split(b"\n", 1)
        return line.decode("ascii").strip()

    def until(self, *wanted: str, timeout_s: float = 2.0) -> str:
        """The next line that starts like one of these; one that starts with ERR is raised, others are passed over."""
        end = time.monotonic() + timeout_s
        while True:
            line = self.line(max(0.0, end - time.monotonic()))
            if line.startswith(wanted):
                return line
            if line.startswith("ERR"):
                raise Refused(line)

    def motion(self, command: str, timeout_s: float = 8.0) -> list[str]:
        """`MOVE(50)`: its ACK and its FIN."""
        name = command.split("(", 1)[0]
        self.send(command)
        return [self.until(f"ACK {name}"), self.until(f"FIN {name}", timeout_s=timeout_s)]

    def at_once(self, command: str) -> str:
        """`FSACK()`: its ACK."""
        self.send(command)
        return self.until(f"ACK {command.split('(', 1)[0]}")

    def value(self, name: str) -> float:
        """`POS?`: the number in `POS=50.0`."""
        self.send(f"{name}?")
        return float(self.until(f"{name}=").split("=", 1)[1])

    def set(self, name: str, value: object) -> str:
        """`PWT=5.0`: answered by the same words."""
        self.send(f"{name}={value}")
        return self.until(f"{name}=").split("=", 1)[1]

    def refusal(self, command: str, timeout_s: float = 8.0) -> Refused:
        """A command that should be refused, at once or at its end, and how it was."""
        self.send(command)
        name = re.split(r"[(?=]", command, maxsplit=1)[0]
        try:
            while True:
                line = self.until(f"ACK {name}", f"FIN {name}", f"{name}=", timeout_s=timeout_s)
                if not line.startswith("ACK"):
                    raise AssertionError(f"{command} was answered by {line!r}, not refused")
        except Refused as refused:
            return refused
