"""The text protocol of Robotiq's URCap, by a client of our own: docs/grippers.md."""

from __future__ import annotations

import time

import cases
import robotiq_socket_client as r
from cases import See, until
from emulator import Emulator
from robotiq_socket_client import RobotiqSocket

case = cases.of("robotiq_socket_client", "robotiq", lambda emulator: RobotiqSocket(emulator.host, emulator.port))


@case("ACT, STA: reset and activate", "--width", "0")
def activate(see: See, client: RobotiqSocket, _: Emulator) -> None:
    see("ACT 0", client.set(ACT=0), "ack")
    see("reset", until(lambda: client.get("STA"), r.RESET)[-1], r.RESET)
    see("GET ACT", client.get("ACT"), 0)
    see("ACT 1", client.set(ACT=1), "ack")
    see("states", until(lambda: client.get("STA"), r.ACTIVE), [r.ACTIVATING, r.ACTIVE])
    see("GET ACT", client.get("ACT"), 1)


@case("ACT: the jaws close and open while activating", "--width", "0")
def activation_moves(see: See, client: RobotiqSocket, _: Emulator) -> None:
    client.set(ACT=0)
    client.wait("STA", r.RESET)
    client.set(ACT=1)
    most = client.get("POS")
    while client.get("STA") != r.ACTIVE:
        most = max(most, client.get("POS"))
    see.over("most closed", most, 200)


@case("not activated, it does not move", "--width", "0")
def not_active(see: See, client: RobotiqSocket, _: Emulator) -> None:
    client.set(ACT=0)
    client.wait("STA", r.RESET)
    before = client.get("POS")
    client.set(POS=200, GTO=1)
    time.sleep(0.3)
    see("POS", client.get("POS"), before)


@case("POS, GTO, OBJ: to a position with nothing there", "--width", "0")
def go(see: See, client: RobotiqSocket, _: Emulator) -> None:
    client.activate()
    for position in (100, 199, 50):
        see(f"OBJ at {position}", client.go(position), r.THERE)
        see("POS", client.get("POS"), position, within=2)


@case("POS from 200 on, with nothing there", "--width", "0")
def go_far(see: See, client: RobotiqSocket, _: Emulator) -> None:
    client.activate()
    for position in (200, 215):
        see(f"OBJ at {position}", client.go(position), r.THERE)
        see("POS", client.get("POS"), position, within=2)
    see("OBJ at 255", client.go(255), r.THERE)
    see.over("POS", client.get("POS"), 220)


@case("POS, GTO, OBJ: onto a part, and off it")
def go_onto(see: See, client: RobotiqSocket, _: Emulator) -> None:
    client.activate()
    client.set(POS=255, SPE=255, FOR=128, GTO=1)
    see("OBJ", until(lambda: client.get("OBJ"), r.STOPPED_CLOSING), [r.MOVING, r.STOPPED_CLOSING])
    see("GTO", client.get("GTO"), 1)
    see("opened again", client.go(0), r.THERE)


@case("GTO 0 stops", "--width", "0")
def stop(see: See, client: RobotiqSocket, _: Emulator) -> None:
    client.activate()
    client.set(POS=255, SPE=255, FOR=0, GTO=1)
    time.sleep(0.4)
    see("GTO 0", client.set(GTO=0), "ack")
    time.sleep(0.1)
    stopped_at = client.get("POS")
    see.over("left to go", 225 - stopped_at, 0)
    time.sleep(0.2)
    see("it stands", client.get("POS"), stopped_at, within=1)
    see("GET GTO", client.get("GTO"), 0)


@case("SPE, FOR are remembered")
def speed_force(see: See, client: RobotiqSocket, _: Emulator) -> None:
    for name in ("SPE", "FOR"):
        for value in (0, 37, 255):
            see(f"SET {name}", client.set(**{name: value}), "ack")
            see(f"GET {name}", client.get(name), value)


@case("FOR: the force on a part")
def force(see: See, client: RobotiqSocket, emulator: Emulator) -> None:
    client.activate()
    client.go(255, force=255)
    time.sleep(1.0)
    words = emulator.end().split()
    # The force table of docs/grippers.md: 0 is 20 N, 255 is 235 N.
    see("force, N per finger", float(words[words.index("N") - 1]), 235.0, within=10.0)


@case("ATR, ADR are remembered")
def release_bits(see: See, client: RobotiqSocket, _: Emulator) -> None:
    for name in ("ATR", "ADR"):
        for value in (1, 0):
            see(f"SET {name}", client.set(**{name: value}), "ack")
            see(f"GET {name}", client.get(name), value)


@case("FLT")
def fault(see: See, client: RobotiqSocket, _: Emulator) -> None:
    see("without a fault", client.get("FLT"), 0)


@case("PRE: the position asked for", "--width", "0")
def request(see: See, client: RobotiqSocket, _: Emulator) -> None:
    client.activate()
    client.go(80)
    client.set(POS=120, GTO=1)
    see("PRE", until(lambda: client.get("PRE"), 120, timeout_s=1.0)[-1], 120)


@case("several variables by one SET")
def several(see: See, client: RobotiqSocket, _: Emulator) -> None:
    client.activate()
    see("bytes", client.raw("SET POS 10 SPE 20 FOR 30 ATR 0 ADR 1 GTO 1"), b"ack")
    got = {name: client.get(name) for name in ("PRE", "SPE", "FOR", "ATR", "ADR", "GTO")}
    see("values", got, {"PRE": 10, "SPE": 20, "FOR": 30, "ATR": 0, "ADR": 1, "GTO": 1})


@case("a line in pieces, 20 ms apart")
def pieces(see: See, client: RobotiqSocket, _: Emulator) -> None:
    client.set(SPE=77)
    for piece in (b"GE", b"T S"):
        client.socket.sendall(piece)
        time.sleep(0.02)
    see("answer", client.ask("PE"), "SPE 77")


@case("nonsense is refused and changes nothing")
def nonsense(see: See, client: RobotiqSocket, _: Emulator) -> None:
    client.set(SPE=77)
    lines = ("HELLO", "SET", "SET SPE", "SET SPE abc", "SET SPE 256", "SET SPE -1", "SET NIL 1", "SET SPE 1 NIL 1")
    for line in lines:
        see(line, client.ask(line) == "ack", False)
    see("GET NIL", client.ask("GET NIL").startswith("NIL "), False)
    see("and the link goes on", client.get("SPE"), 77)


@case("what is only read is not set")
def read_only(see: See, client: RobotiqSocket, _: Emulator) -> None:
    before = {name: client.get(name) for name in ("STA", "OBJ", "FLT")}
    for name in before:
        see(f"SET {name} 2", client.ask(f"SET {name} 2") == "ack", False)
    see("values", {name: client.get(name) for name in before}, before)
