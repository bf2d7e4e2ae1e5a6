"""The text interface of the WSG-50: docs/grippers.md, and Weiss' GCL reference for what is not there."""

from __future__ import annotations

import time

import cases
import gcl_client as g
from cases import See, until
from emulator import Emulator
from gcl_client import Gcl

case = cases.of("gcl_client", "gcl", lambda emulator: Gcl(emulator.host, emulator.port))


@case("HOME()", "--width", "0")
def home(see: See, client: Gcl, _: Emulator) -> None:
    see("HOME()", client.motion("HOME()"), ["ACK HOME", "FIN HOME"])


@case("HOME(1), HOME(0): towards open, towards closed", "--width", "0")
def home_direction(see: See, client: Gcl, _: Emulator) -> None:
    client.motion("MOVE(60)")
    see("HOME(1)", client.motion("HOME(1)"), ["ACK HOME", "FIN HOME"])
    see("opening, mm", client.value("POS"), 110.0, within=0.5)
    see("HOME(0)", client.motion("HOME(0)"), ["ACK HOME", "FIN HOME"])
    see("opening, mm", client.value("POS"), 0.0, within=0.5)


@case("MOVE(w)")
def move(see: See, client: Gcl, _: Emulator) -> None:
    see("MOVE(80)", client.motion("MOVE(80)"), ["ACK MOVE", "FIN MOVE"])
    see("POS?, mm", client.value("POS"), 80.0, within=0.5)


@case("MOVE(w,v)")
def move_speed(see: See, client: Gcl, _: Emulator) -> None:
    see("MOVE(90,100)", client.motion("MOVE(90.0,100.0)"), ["ACK MOVE", "FIN MOVE"])
    see("POS?, mm", client.value("POS"), 90.0, within=0.5)


@case("MOVE(w,v) keeps to its speed limit")
def move_slowly(see: See, client: Gcl, _: Emulator) -> None:
    start = time.monotonic()
    see("MOVE(90,20)", client.motion("MOVE(90,20)"), ["ACK MOVE", "FIN MOVE"])
    see.over("20 mm with 20 mm/s, s", time.monotonic() - start, 0.9)


@case("MOVE(w) onto a part ends")
def move_onto(see: See, client: Gcl, _: Emulator) -> None:
    see("code", client.refusal("MOVE(40)").code, g.AXIS_BLOCKED)
    see("POS?, mm", client.value("POS"), 50.0, within=0.5)


@case("GRIP(f)")
def grip(see: See, client: Gcl, _: Emulator) -> None:
    see("GRIP(20)", client.motion("GRIP(20)"), ["ACK GRIP", "FIN GRIP"])
    see("GRIPSTATE?", client.value("GRIPSTATE"), g.HOLDING)
    time.sleep(0.5)
    see("FORCE?, N", client.value("FORCE"), 20.0, within=2.0)
    see("POS?, mm", client.value("POS"), 50.0, within=0.5)


@case("GRIP()")
def grip_default(see: See, client: Gcl, _: Emulator) -> None:
    see("GRIP()", client.motion("GRIP()"), ["ACK GRIP", "FIN GRIP"])
    see("GRIPSTATE?", client.value("GRIPSTATE"), g.HOLDING)
    time.sleep(0.5)
    see.over("FORCE?, N", client.value("FORCE"), 4.0)


@case("GRIP(f,w), GRIP(f,w,v)")
def grip_width(see: See, client: Gcl, _: Emulator) -> None:
    see("GRIP(30,50)", client.motion("GRIP(30,50)"), ["ACK GRIP", "FIN GRIP"])
    see("RELEASE", client.motion("RELEASE(10,100)"), ["ACK RELEASE", "FIN RELEASE"])
    see("GRIP(40,50,100)", client.motion("GRIP(40,50,100)"), ["ACK GRIP", "FIN GRIP"])
    time.sleep(0.5)
    see("FORCE?, N", client.value("FORCE"), 40.0, within=3.0)


@case("GRIP() with nothing there closes on itself and holds", "--width", "0")
def grip_itself(see: See, client: Gcl, _: Emulator) -> None:
    answers = []
    client.send("GRIP(20)")
    while not answers or answers[-1].startswith("ACK"):
        answers.append(client.line(8.0))
    see("GRIP(20)", answers, ["ACK GRIP", "FIN GRIP"])
    see("GRIPSTATE?", client.value("GRIPSTATE"), g.HOLDING)
    see("POS?, mm", client.value("POS"), 0.0, within=0.5)


@case("GRIP(f,w) with nothing there, or far from w", "--width", "50")
def grip_nothing(see: See, client: Gcl, _: Emulator) -> None:
    see("nothing at 80 mm", client.refusal("GRIP(20,80)").code, g.FAILED)
    see("GRIPSTATE?", client.value("GRIPSTATE"), g.NO_PART)
    client.motion("MOVE(100)")
    see("a part of 50 mm, 20 expected", client.refusal("GRIP(20,20)").code, g.AXIS_BLOCKED)


@case("GRIP while a part is held is refused")
def grip_again(see: See, client: Gcl, _: Emulator) -> None:
    client.motion("GRIP(20)")
    see("code", client.refusal("GRIP(30)").code, g.ACCESS_DENIED)
    see("GRIPSTATE?", client.value("GRIPSTATE"), g.HOLDING)


@case("RELEASE(d), RELEASE(d,v)")
def release(see: See, client: Gcl, _: Emulator) -> None:
    for command in ("RELEASE(12)", "RELEASE(12,100)"):
        client.motion("GRIP(20)")
        see(command, client.motion(command), ["ACK RELEASE", "FIN RELEASE"])
        see("POS?, mm", client.value("POS"), 62.0, within=0.5)
        see("GRIPSTATE?", client.value("GRIPSTATE"), g.IDLE)


@case("RELEASE()")
def release_default(see: See, client: Gcl, _: Emulator) -> None:
    client.motion("GRIP(20)")
    see("RELEASE()", client.motion("RELEASE()"), ["ACK RELEASE", "FIN RELEASE"])
    see.over("POS?, mm", client.value("POS"), 50.5)


@case("RELEASE without a grip is refused")
def release_nothing(see: See, client: Gcl, _: Emulator) -> None:
    client.motion("MOVE(80)")
    see("code", client.refusal("RELEASE(5)").code, g.ACCESS_DENIED)


@case("STOP() ends a MOVE")
def stop(see: See, client: Gcl, _: Emulator) -> None:
    client.send("MOVE(60,50)")
    see("MOVE", client.until("ACK MOVE"), "ACK MOVE")
    time.sleep(0.2)
    client.send("STOP()")
    lines = sorted([client.line(), client.line()])
    see("STOP", lines[0], "ACK STOP")
    see("MOVE", g.Refused(lines[1]).code, g.ABORTED)
    see.over("POS?, mm", client.value("POS"), 61.0)


@case("VERBOSE: errors by number, then by name")
def verbose(see: See, client: Gcl, _: Emulator) -> None:
    number = client.refusal("MOVE(500)")
    see("code", (number.command, number.code, number.is_named), ("MOVE", g.OUT_OF_RANGE, False))
    see("VERBOSE=1", client.set("VERBOSE", 1), "1")
    named = client.refusal("MOVE(500)")
    see("code", (named.command, named.code, named.is_named), ("MOVE", g.OUT_OF_RANGE, True))
    see("VERBOSE=0", client.set("VERBOSE", 0), "0")
    see("by number", client.refusal("MOVE(500)").is_named, False)


@case("what is wrong is refused: range, words, unknown commands")
def refused(see: See, client: Gcl, _: Emulator) -> None:
    see("GRIP(500)", client.refusal("GRIP(500)").code, g.OUT_OF_RANGE)
    see("MOVE(80,9999)", client.refusal("MOVE(80,9999)").code, g.OUT_OF_RANGE)
    see.one_of("MOVE()", client.refusal("MOVE()").code, g.FORMAT, g.NOT_ENOUGH_PARAMS)
    see.one_of("MOVE(abc)", client.refusal("MOVE(abc)").code, g.FORMAT, g.INVALID_PARAMETER)
    see("NONSENSE()", client.refusal("NONSENSE()").code, g.UNKNOWN_COMMAND)
    see("nothing moved, mm", client.value("POS"), 110.0, within=0.5)


@case("FSTOP(), FASTSTOP() and FSACK()")
def fast_stop(see: See, client: Gcl, _: Emulator) -> None:
    for name in ("FSTOP", "FASTSTOP"):
        see(name, client.at_once(f"{name}()"), f"ACK {name}")
        see("MOVE", client.refusal("MOVE(80)").code, g.ACCESS_DENIED)
        see("FSACK()", client.at_once("FSACK()"), "ACK FSACK")
        see("MOVE again", client.motion("MOVE(100)"), ["ACK MOVE", "FIN MOVE"])


@case("BYE() before closing; a link cut without it latches a fast stop")
def bye(see: See, client: Gcl, emulator: Emulator) -> None:
    see("BYE()", client.at_once("BYE()"), "ACK BYE")
    client.close()
    second = Gcl(emulator.host, emulator.port)
    see("after BYE()", second.motion("MOVE(100)"), ["ACK MOVE", "FIN MOVE"])
    second.close()
    time.sleep(0.1)
    third = Gcl(emulator.host, emulator.port)
    see("after a cut", third.refusal("MOVE(90)").code, g.ACCESS_DENIED)
    third.close()


def by_itself(client: Gcl, name: str) -> str:
    """The next value that comes without being asked for."""
    return client.until(f"@{name}=", f"{name}=", timeout_s=1.0)


@case("AUTOSEND: values by themselves, marked by @")
def autosend(see: See, client: Gcl, _: Emulator) -> None:
    for name in ("POS", "FORCE", "SPEED", "GRIPSTATE"):
        client.send(f'AUTOSEND("{name}",20)')
        see("AUTOSEND", client.until("ACK AUTOSEND"), "ACK AUTOSEND")
        start = time.monotonic()
        lines = [by_itself(client, name) for _ in range(10)]
        see.over("10 periods, s", time.monotonic() - start, 0.12)
        client.send(f'AUTOSEND("{name}",0)')
        client.until("ACK AUTOSEND")
        client.pending = b""
        see(f"how {name} came", {line.split("=")[0] for line in lines}, {f"@{name}"})


@case("AUTOSEND: a period of 0 ends it, an unknown value is refused")
def autosend_ends(see: See, client: Gcl, _: Emulator) -> None:
    client.send('AUTOSEND("POS",20)')
    see("AUTOSEND", client.until("ACK AUTOSEND"), "ACK AUTOSEND")
    by_itself(client, "POS")
    client.send('AUTOSEND("POS",0)')
    see("ended", client.until("ACK AUTOSEND"), "ACK AUTOSEND")
    time.sleep(0.1)
    client.pending = b""
    client.value("GRIPSTATE")
    see.silence("after the end", lambda: client.line(0.3), TimeoutError)
    see.over("unknown value", client.refusal('AUTOSEND("NONSENSE",20)').code, 0)


@case("PWT=, PWT?, CLT=, CLT?")
def tolerances(see: See, client: Gcl, _: Emulator) -> None:
    for name in ("PWT", "CLT"):
        before_mm = client.value(name)
        see(f"{name}=", float(client.set(name, before_mm + 1.5)), before_mm + 1.5, within=1e-3)
        see(f"{name}?, mm", client.value(name), before_mm + 1.5, within=1e-3)
        see.over(f"{name}=-1", client.refusal(f"{name}=-1").code, 0)


@case("PWT and CLT are as configured again on the next connection")
def tolerances_end(see: See, client: Gcl, emulator: Emulator) -> None:
    configured = {name: client.value(name) for name in ("PWT", "CLT")}
    for name, value_mm in configured.items():
        client.set(name, value_mm + 1.5)
    client.at_once("BYE()")
    client.close()
    second = Gcl(emulator.host, emulator.port)
    see("mm", {name: second.value(name) for name in configured}, configured)
    second.close()


@case("POS?, SPEED?, FORCE?, GRIPSTATE? on the way")
def questions(see: See, client: Gcl, _: Emulator) -> None:
    client.send("MOVE(60,50)")
    client.until("ACK MOVE")
    time.sleep(0.2)
    see("GRIPSTATE?", client.value("GRIPSTATE"), g.POSITIONING)
    see("SPEED?, mm/s", abs(client.value("SPEED")), 50.0, within=10.0)
    see.over("POS?, mm", client.value("POS"), 60.0)
    see("FORCE?, N", client.value("FORCE"), 0.0, within=1.0)
    see("MOVE", client.until("FIN MOVE"), "FIN MOVE")
    see("SPEED?, mm/s", client.value("SPEED"), 0.0, within=0.5)


@case("a part that is lost is told", "--fail", "lose-part@4000")
def lost(see: See, client: Gcl, _: Emulator) -> None:
    client.motion("GRIP(20,50)")
    see("states", until(lambda: client.value("GRIPSTATE"), g.PART_LOST), [g.HOLDING, g.PART_LOST])
