"""The table client x command, from what was run."""

from __future__ import annotations

import importlib.metadata
import subprocess

import pytest
from cases import CASES, Case
from emulator import PROGRAM, ROOT

RESULTS = pytest.StashKey[dict[Case, str]]()
PAGE = ROOT / "docs" / "foreign-clients.md"
TITLES = {
    "wsg50": "WSG-50, binary interface",
    "gcl": "WSG-50, text interface (GCL)",
    "robotiq": "Robotiq 2F-85, text protocol at port 63352",
    "robotiq-rtu": "Robotiq 2F-85, Modbus RTU on a pseudo-terminal",
}
# Those of Modbus, in the order of their columns; others stand in a table of their own.
ORDER = ("pymodbus", "minimalmodbus", "pyRobotiqGripper", "pySerial")
PACKAGES = ("pymodbus", "minimalmodbus", "pyRobotiqGripper", "pyserial")


def reason(error: BaseException) -> str:
    """What went wrong, in a cell of a table."""
    words = " ".join(str(error).split()) or type(error).__name__
    if "No response received" in words:
        words = "no answer"  # what pymodbus says, in short
    elif not isinstance(error, AssertionError):
        words = f"{type(error).__name__}: {words}"
    return words.replace("|", "/")[:160]


def _column(case: Case) -> int:
    return ORDER.index(case.client) if case.client in ORDER else 0


def text(results: dict[Case, str]) -> str:
    """One table a protocol; an empty cell was not tried with that client."""
    parts = []
    for protocol, title in TITLES.items():
        rows = {case: results[case] for case in sorted(results, key=_column) if case.protocol == protocol}
        clients = list(dict.fromkeys(case.client for case in rows))
        commands = list(dict.fromkeys(case.command for case in rows))
        if not rows:
            continue
        by_place = {(case.command, case.client): said for case, said in rows.items()}
        lines = [f"## {title}", "", f"| command | {' | '.join(clients)} |", "|---" * (1 + len(clients)) + "|"]
        for command in commands:
            cells = [by_place.get((command, client), "") for client in clients]
            lines.append(f"| {command} | {' | '.join(cells)} |")
        parts.append("\n".join(lines) + "\n")
    count = sum(said == "ok" for said in results.values())
    return "\n".join([*parts, f"{count} of {len(results)} are ok.\n"])


def page(results: dict[Case, str]) -> str:
    """The whole of docs/foreign-clients.md."""
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    program = subprocess.run([PROGRAM, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    return f"""# The emulators tried by foreign clients

Made by `pytest -p no:cacheprovider tests/foreign --write` ({program}, {versions}). Do not edit.

pymodbus, minimalmodbus, pySerial and pyRobotiqGripper are third-party clients. `wsg50_client`, `gcl_client` and
`robotiq_socket_client` are small clients in `tests/foreign/`, written from the protocols and not from our drivers.
Each cell is a command, or a few that belong together, sent to a fresh emulator: `ok`, or the expected and the received
answer; empty where it was not tried with that client. Expected is what the protocol specifies, whether or not the emulator
does it. None of this was tested on a real gripper.

{text(results)}"""


def write(results: dict[Case, str]) -> str:
    """Writes the page, if every case was run."""
    if missing := [case.name for case in CASES if case not in results]:
        return f"{PAGE.name} is not written: {len(missing)} cases were not run"
    PAGE.write_text(page(results), encoding="utf-8")
    return f"{PAGE.relative_to(ROOT)} is written"
