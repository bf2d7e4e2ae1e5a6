"""The binary interface of the WSG-50: docs/grippers.md, and Weiss' command set reference for what is not there."""

from __future__ import annotations

import struct
import time

import cases
import wsg50_client as w
from cases import See, until
from emulator import Emulator
from wsg50_client import Wsg50

case = cases.of("wsg50_client", "wsg50", lambda emulator: Wsg50(emulator.host, emulator.port))


def opening(client: Wsg50) -> float:
    return client.state(w.OPENING).f32()


def system(client: Wsg50) -> int:
    return client.state(w.SYSTEM_STATE).u32()


def grasp_state(client: Wsg50) -> int:
    return client.state(w.GRASP_STATE).u8()


@case("frames as on the page, sent byte by byte")
def frames(see: See, client: Wsg50, _: Emulator) -> None:
    see("command 0x01", w.frame(0x01).hex(" "), "aa aa aa 01 00 00 e8 10")
    see("status 0 of homing", w.frame(w.HOME, b"\0\0").hex(" "), "aa aa aa 20 02 00 00 00 b3 fd")
    limit = w.frame(w.SET_FORCE, struct.pack("<f", 20.0))
    see("force limit of 20 N", limit.hex(" "), "aa aa aa 32 04 00 00 00 a0 41 f5 22")
    see("acknowledge", w.frame(w.ACKNOWLEDGE, b"ack").hex(" "), "aa aa aa 24 03 00 61 63 6b dc b9")
    for byte in limit:
        client.socket.sendall(bytes([byte]))
        time.sleep(0.002)
    see("status", client.answer(w.SET_FORCE).status, w.OK)
    see("force limit, N", client.get_f32(w.GET_FORCE), 20.0, within=1e-4)


@case("two commands in one packet")
def two(see: See, client: Wsg50, _: Emulator) -> None:
    client.socket.sendall(w.frame(w.GET_FORCE) + w.frame(w.GET_ACCELERATION))
    see("first", client.receive().command, w.GET_FORCE)
    see("second", client.receive().command, w.GET_ACCELERATION)


@case("a frame with a wrong checksum changes nothing")
def checksum(see: See, client: Wsg50, _: Emulator) -> None:
    see("force limit of 30 N", client.set_f32(w.SET_FORCE, 30.0), w.OK)
    spoilt = bytearray(w.frame(w.SET_FORCE, struct.pack("<f", 20.0)))
    spoilt[-1] ^= 0xFF
    client.socket.sendall(bytes(spoilt))
    see("force limit, N", client.get_f32(w.GET_FORCE), 30.0, within=1e-4)


@case("HOME 0x20, as configured", "--width", "0")
def home(see: See, client: Wsg50, _: Emulator) -> None:
    see("statuses", client.home(0), [w.PENDING, w.OK])
    see("referenced", system(client) & w.REFERENCED, w.REFERENCED)


@case("HOME 0x20 towards open", "--width", "0")
def home_open(see: See, client: Wsg50, _: Emulator) -> None:
    see("MOVE", client.move(60.0, 200.0), [w.PENDING, w.OK])
    see("statuses", client.home(1), [w.PENDING, w.OK])
    see("opening, mm", opening(client), 110.0, within=0.5)


@case("HOME 0x20 towards closed", "--width", "0")
def home_closed(see: See, client: Wsg50, _: Emulator) -> None:
    see("statuses", client.home(2), [w.PENDING, w.OK])
    see("opening, mm", opening(client), 0.0, within=0.5)


@case("MOVE 0x21")
def move(see: See, client: Wsg50, _: Emulator) -> None:
    see("statuses", client.move(80.0, 200.0), [w.PENDING, w.OK])
    see("opening, mm", opening(client), 80.0, within=0.5)


@case("MOVE 0x21 keeps to its speed limit")
def move_slowly(see: See, client: Wsg50, _: Emulator) -> None:
    start = time.monotonic()
    see("statuses", client.move(90.0, 20.0), [w.PENDING, w.OK])
    see.over("20 mm with 20 mm/s, s", time.monotonic() - start, 0.9)


@case("MOVE 0x21, relative")
def move_relative(see: See, client: Wsg50, _: Emulator) -> None:
    client.move(80.0, 200.0)
    see("statuses", client.move(-10.0, 200.0, w.RELATIVE), [w.PENDING, w.OK])
    see("opening, mm", opening(client), 70.0, within=0.5)


@case("MOVE 0x21 out of range is refused")
def move_far(see: See, client: Wsg50, _: Emulator) -> None:
    see("to 500 mm", client.move(500.0, 100.0), [w.OUT_OF_RANGE])
    see("with 1 mm/s", client.move(80.0, 1.0), [w.OUT_OF_RANGE])
    see("with 1000 mm/s", client.move(80.0, 1000.0), [w.OUT_OF_RANGE])


@case("MOVE 0x21 onto a part ends")
def move_onto(see: See, client: Wsg50, _: Emulator) -> None:
    see("statuses", client.move(40.0, 200.0), [w.PENDING, w.AXIS_BLOCKED])
    see("opening, mm", opening(client), 50.0, within=0.5)
    see("MOVE off it", client.move(80.0, 200.0), [w.PENDING, w.OK])


@case("MOVE 0x21 onto a part clamps, or stops if so told")
def move_clamps(see: See, client: Wsg50, _: Emulator) -> None:
    client.set_f32(w.SET_FORCE, 20.0)
    client.move(40.0, 200.0, w.STOP_ON_BLOCK)
    time.sleep(0.5)
    see("force with stop on block, N", client.state(w.FORCE).f32(), 0.0, within=1.0)
    client.move(80.0, 200.0)
    client.move(40.0, 200.0)
    time.sleep(0.5)
    see("force without, N", client.state(w.FORCE).f32(), 20.0, within=2.0)


@case("STOP 0x22 ends a MOVE")
def stop(see: See, client: Wsg50, _: Emulator) -> None:
    client.send(w.MOVE, struct.pack("<Bff", 0, 60.0, 50.0))
    see("MOVE at first", client.answer(w.MOVE).status, w.PENDING)
    time.sleep(0.2)
    client.send(w.STOP)
    replies = {reply.command: reply.status for reply in (client.receive(), client.receive())}
    see("STOP and MOVE", replies, {w.STOP: w.OK, w.MOVE: w.ABORTED})
    time.sleep(0.2)
    stopped_at_mm = opening(client)
    see.over("opening, mm", stopped_at_mm, 61.0)
    time.sleep(0.2)
    see("it stands, mm", opening(client), stopped_at_mm, within=0.5)


@case("acceleration 0x30, 0x31")
def acceleration(see: See, client: Wsg50, _: Emulator) -> None:
    see("set", client.set_f32(w.SET_ACCELERATION, 2000.0), w.OK)
    see("get, mm/s2", client.get_f32(w.GET_ACCELERATION), 2000.0, within=1e-3)
    see("out of range", client.set_f32(w.SET_ACCELERATION, 1e6), w.OUT_OF_RANGE)
    see("unchanged, mm/s2", client.get_f32(w.GET_ACCELERATION), 2000.0, within=1e-3)


@case("force limit 0x32, 0x33")
def force_limit(see: See, client: Wsg50, _: Emulator) -> None:
    for limit_n in (5.0, 20.0, 80.0):
        see("set", client.set_f32(w.SET_FORCE, limit_n), w.OK)
        see("get, N", client.get_f32(w.GET_FORCE), limit_n, within=1e-4)
    see("4 N", client.set_f32(w.SET_FORCE, 4.0), w.OUT_OF_RANGE)
    see("81 N", client.set_f32(w.SET_FORCE, 81.0), w.OUT_OF_RANGE)
    see("unchanged, N", client.get_f32(w.GET_FORCE), 80.0, within=1e-4)


@case("tare 0x38")
def tare(see: See, client: Wsg50, _: Emulator) -> None:
    see("free", client.ask(w.TARE).status, w.OK)
    client.grasp(50.0, 200.0)
    see("while it presses", client.ask(w.TARE).status, w.ACCESS_DENIED)


@case("GRASP 0x25")
def grasp(see: See, client: Wsg50, _: Emulator) -> None:
    client.set_f32(w.SET_FORCE, 20.0)
    client.send(w.GRASP, struct.pack("<ff", 50.0, 100.0))
    see("at first", client.answer(w.GRASP).status, w.PENDING)
    see("state on the way", grasp_state(client), w.GRASPING)
    see("at the end", client.answer(w.GRASP, 8.0).status, w.OK)
    see("state", grasp_state(client), w.HOLDING)
    time.sleep(0.5)
    see("force, N", client.state(w.FORCE).f32(), 20.0, within=2.0)
    see("opening, mm", opening(client), 50.0, within=0.5)


@case("GRASP 0x25 with nothing there", "--width", "0")
def grasp_nothing(see: See, client: Wsg50, _: Emulator) -> None:
    see("statuses", client.grasp(50.0, 200.0), [w.PENDING, w.FAILED])
    see("state", grasp_state(client), w.NO_PART)


@case("GRASP 0x25 of a part far thicker than told")
def grasp_collision(see: See, client: Wsg50, _: Emulator) -> None:
    see("statuses", client.grasp(20.0, 200.0), [w.PENDING, w.AXIS_BLOCKED])


@case("a part that is lost is told", "--fail", "lose-part@3000")
def lost(see: See, client: Wsg50, _: Emulator) -> None:
    see("GRASP", client.grasp(50.0, 400.0), [w.PENDING, w.OK])
    see("states", until(lambda: grasp_state(client), w.PART_LOST), [w.HOLDING, w.PART_LOST])


@case("RELEASE 0x26")
def release(see: See, client: Wsg50, _: Emulator) -> None:
    client.grasp(50.0, 200.0)
    client.send(w.RELEASE, struct.pack("<ff", 90.0, 100.0))
    see("at first", client.answer(w.RELEASE).status, w.PENDING)
    see("state on the way", grasp_state(client), w.RELEASING)
    see("at the end", client.answer(w.RELEASE, 8.0).status, w.OK)
    see("state", grasp_state(client), w.IDLE)
    see("opening, mm", opening(client), 90.0, within=0.5)
    see("force, N", client.state(w.FORCE).f32(), 0.0, within=1.0)


@case("states 0x40, 0x41, 0x43, 0x44, 0x45 on the way and at the end")
def states(see: See, client: Wsg50, _: Emulator) -> None:
    client.send(w.MOVE, struct.pack("<Bff", 0, 60.0, 50.0))
    client.answer(w.MOVE)
    time.sleep(0.2)
    see("POSITIONING", grasp_state(client), w.POSITIONING)
    see.over("opening, mm", opening(client), 60.0)
    see("force, N", client.state(w.FORCE).f32(), 0.0, within=1.0)
    see("MOVING", system(client) & w.MOVING, w.MOVING)
    see.over("speed either way, mm/s", abs(client.state(w.SPEED).f32()), 5.0)
    see("MOVE", client.answer(w.MOVE, 8.0).status, w.OK)
    see("speed at the end, mm/s", client.state(w.SPEED).f32(), 0.0, within=0.5)
    see("IDLE", grasp_state(client), w.IDLE)
    see("MOVING no more", system(client) & w.MOVING, 0)


@case("system state 0x40: TARGET_POS_REACHED, BLOCKED_MINUS, AXIS_STOPPED")
def flags(see: See, client: Wsg50, _: Emulator) -> None:
    ends = w.TARGET_REACHED | w.BLOCKED_CLOSING | w.AXIS_STOPPED
    client.move(80.0, 200.0)
    see("after a MOVE", system(client) & ends, w.TARGET_REACHED)
    client.move(40.0, 200.0)
    see("after a MOVE onto a part", system(client) & ends, w.BLOCKED_CLOSING)
    client.send(w.MOVE, struct.pack("<Bff", 0, 100.0, 50.0))
    client.answer(w.MOVE)
    time.sleep(0.2)
    client.ask(w.STOP)
    see("after a STOP", system(client) & ends, w.AXIS_STOPPED)


@case("states by themselves, every period")
def updates(see: See, client: Wsg50, _: Emulator) -> None:
    client.state(w.OPENING, period_ms=20, flags=0b01)
    start = time.monotonic()
    for _i in range(20):
        see("which", client.receive().command, w.OPENING)
    see.over("20 periods, s", time.monotonic() - start, 0.3)
    client.state(w.OPENING)
    time.sleep(0.1)
    client.get_f32(w.GET_FORCE)
    see.silence("ended", lambda: client.receive(0.3), TimeoutError)


@case("states by themselves, on change only")
def changes(see: See, client: Wsg50, _: Emulator) -> None:
    client.state(w.OPENING, period_ms=20, flags=0b11)
    time.sleep(0.1)
    client.get_f32(w.GET_FORCE)
    see.silence("nothing changes", lambda: client.receive(0.3), TimeoutError)
    client.send(w.MOVE, struct.pack("<Bff", 0, 80.0, 100.0))
    see.over("something changes, mm", 110.0 - client.answer(w.OPENING).f32(), -0.01)


@case("FAST STOP 0x23 and acknowledge 0x24")
def fast_stop(see: See, client: Wsg50, _: Emulator) -> None:
    see("FAST STOP", client.ask(w.FAST_STOP).status, w.OK)
    see("latched", system(client) & w.FAST_STOPPED, w.FAST_STOPPED)
    see("MOVE", client.move(80.0, 100.0), [w.ACCESS_DENIED])
    see.over("acknowledge without its word", client.ask(w.ACKNOWLEDGE, b"nak").status, 0)
    see("still latched", system(client) & w.FAST_STOPPED, w.FAST_STOPPED)
    see("acknowledge", client.acknowledge(), w.OK)
    see("not latched", system(client) & w.FAST_STOPPED, 0)
    see("MOVE again", client.move(100.0, 100.0), [w.PENDING, w.OK])


@case("0x07 before closing; a link cut without it latches a fast stop")
def disconnect(see: See, client: Wsg50, emulator: Emulator) -> None:
    see("0x07", client.leave(), w.OK)
    second = Wsg50(emulator.host, emulator.port)
    see("after 0x07", system(second) & w.FAST_STOPPED, 0)
    second.close()
    time.sleep(0.1)
    third = Wsg50(emulator.host, emulator.port)
    see("after a cut", system(third) & w.FAST_STOPPED, w.FAST_STOPPED)
    third.close()


@case("an unknown command is refused")
def unknown(see: See, client: Wsg50, _: Emulator) -> None:
    for command in (0x99, 0xF0):
        reply = client.ask(command)
        see(f"0x{command:02X}", reply.status, w.UNKNOWN_COMMAND)
    see("and the link goes on, N", client.get_f32(w.GET_FORCE), 80.0, within=1e-4)
