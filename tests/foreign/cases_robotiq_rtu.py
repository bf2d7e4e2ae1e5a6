"""Modbus RTU of the Robotiq 2F-85 by clients that others wrote: pymodbus, minimalmodbus and pySerial."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import cases
import minimalmodbus
import serial
from cases import See, until
from emulator import Emulator
from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ModbusIOException

logging.getLogger("pymodbus").setLevel(logging.CRITICAL)

SLAVE, OUTPUTS, INPUTS = 9, 1000, 2000
ACTIVATE, GO, RELEASE, RELEASE_OPENING = 0x0100, 0x0800, 0x1000, 0x2000
MOVING, STOPPED_CLOSING, THERE = 0, 2, 3


class Registers:
    """Reading and writing registers, by whichever library. A refusal is answered by `refused N`."""

    def __init__(self, read: Callable, write_one: Callable, write: Callable, close: Callable) -> None:
        self.read, self.write_one, self.write, self.close = read, write_one, write, close

    def status(self) -> tuple[int, int, int, int, int]:
        """ACT, STA, OBJ, position and current."""
        first, _, third = self.read(4, INPUTS, 3)
        status = first >> 8
        return status & 1, status >> 4 & 3, status >> 6, third >> 8, third & 0xFF

    def activate(self) -> None:
        self.write(OUTPUTS, [0, 0, 0])
        until(lambda: self.status()[1], 0)
        self.write(OUTPUTS, [ACTIVATE])
        until(lambda: self.status()[1], 3)

    def go(self, position: int, force: int = 128) -> int:
        """Moves, and says how it stopped."""
        self.write(OUTPUTS, [ACTIVATE | GO, position, 0xFF00 | force])
        until(lambda: self.status()[2] != MOVING, True)
        return self.status()[2]


def pymodbus_client(emulator: Emulator) -> Registers:
    client = ModbusSerialClient(port=emulator.address, baudrate=115200, timeout=1, retries=0)
    assert client.connect()

    def answer(reply: object) -> object:
        if reply.isError():
            return f"refused {reply.exception_code}"
        return list(reply.registers)

    def read(function: int, address: int, count: int) -> object:
        ask = {3: client.read_holding_registers, 4: client.read_input_registers}[function]
        return answer(ask(address, count=count, device_id=SLAVE))

    def write_one(address: int, value: int) -> object:
        return answer(client.write_register(address, value, device_id=SLAVE))

    def write(address: int, values: list[int]) -> object:
        return answer(client.write_registers(address, values, device_id=SLAVE))

    registers = Registers(read, write_one, write, client.close)
    registers.client, registers.answer = client, answer
    return registers


def minimalmodbus_client(emulator: Emulator) -> Registers:
    client = minimalmodbus.Instrument(emulator.address, SLAVE)
    client.serial.baudrate, client.serial.timeout = 115200, 1.0

    def refused(ask: Callable[[], object]) -> object:
        try:
            return ask()
        except minimalmodbus.IllegalRequestError as error:
            numbers = {"illegal function": 1, "illegal data address": 2}
            return f"refused {numbers[str(error).split('reported ')[1]]}"

    def read(function: int, address: int, count: int) -> object:
        return refused(lambda: client.read_registers(address, count, functioncode=function))

    def write_one(address: int, value: int) -> object:
        return refused(lambda: client.write_register(address, value, functioncode=6))

    def write(address: int, values: list[int]) -> object:
        return refused(lambda: client.write_registers(address, values))

    registers = Registers(read, write_one, write, client.serial.close)
    registers.client, registers.refused = client, refused
    return registers


BOTH = [
    cases.of("pymodbus", "robotiq-rtu", pymodbus_client),
    cases.of("minimalmodbus", "robotiq-rtu", minimalmodbus_client),
]


def both(command: str, *arguments: str) -> Callable:
    """A case of each of the two libraries."""

    def keep(body: Callable) -> Callable:
        for case in BOTH:
            body = case(command, *arguments)(body)
        return body

    return keep


@both("functions 3, 4: registers 2000 to 2002, one to three at once")
def read_inputs(see: See, client: Registers, _: Emulator) -> None:
    client.activate()
    whole = client.read(4, INPUTS, 3)
    see("STA and ACT", whole[0] >> 8 & 0x31, 0x31)
    for function in (3, 4):
        for first in range(3):
            for count in range(1, 4 - first):
                got = client.read(function, INPUTS + first, count)
                see(f"function {function}, {INPUTS + first}, {count}", got, whole[first : first + count])


@both("functions 3, 4: registers 1000 to 1002")
def read_outputs(see: See, client: Registers, _: Emulator) -> None:
    written = [ACTIVATE, 17, 0x2A3B]
    client.write(OUTPUTS, written)
    for function in (3, 4):
        see(f"function {function}", client.read(function, OUTPUTS, 3), written)
        see(f"function {function}, one", client.read(function, OUTPUTS + 1, 1), written[1:2])


@both("function 6: each register alone")
def write_one(see: See, client: Registers, _: Emulator) -> None:
    for offset, value in enumerate([ACTIVATE, 33, 0x4455]):
        client.write_one(OUTPUTS + offset, value)
        see(f"register {OUTPUTS + offset}", client.read(3, OUTPUTS + offset, 1), [value])


@both("function 16: one, two and three registers")
def write_some(see: See, client: Registers, _: Emulator) -> None:
    for first, values in ((0, [ACTIVATE, 1, 0x0203]), (1, [4, 0x0506]), (0, [ACTIVATE, 7]), (2, [0x0809])):
        client.write(OUTPUTS + first, values)
        see(f"from {OUTPUTS + first}", client.read(3, OUTPUTS + first, len(values)), values)
    see("all", client.read(3, OUTPUTS, 3), [ACTIVATE, 7, 0x0809])


@both("activate")
def activate(see: See, client: Registers, _: Emulator) -> None:
    client.write(OUTPUTS, [0, 0, 0])
    see("reset", until(lambda: client.status()[:2], (0, 0))[-1], (0, 0))
    client.write(OUTPUTS, [ACTIVATE])
    see("ACT, STA", until(lambda: client.status()[:2], (1, 3)), [(1, 1), (1, 3)])


@both("activate: the jaws close and open", "--width", "0")
def activation_moves(see: See, client: Registers, _: Emulator) -> None:
    client.write(OUTPUTS, [0, 0, 0])
    until(lambda: client.status()[1], 0)
    client.write(OUTPUTS, [ACTIVATE])
    most, is_active = 0, False
    while not is_active:
        _act, state, _obj, position, _current = client.status()
        most, is_active = max(most, position), state == 3
    see.over("most closed", most, 200)


@both("go to, read position and object status", "--width", "0")
def go(see: See, client: Registers, _: Emulator) -> None:
    client.activate()
    for position in (150, 20):
        see("OBJ", client.go(position), THERE)
        see("position", client.status()[3], position, within=2)
        see("no fault, position asked for", client.read(4, INPUTS + 1, 1), [position])


@both("go to, onto a part: object status and current")
def go_onto(see: See, client: Registers, _: Emulator) -> None:
    client.activate()
    see("OBJ", client.go(255), STOPPED_CLOSING)
    time.sleep(0.5)
    see.over("current, 10 mA", client.status()[4], 0)
    see.over("position short of 255 by", 255 - client.status()[3], 50)


@both("GTO 0 stops", "--width", "0")
def stop(see: See, client: Registers, _: Emulator) -> None:
    client.activate()
    client.write(OUTPUTS, [ACTIVATE | GO, 255, 0xFF00])
    time.sleep(0.4)
    client.write_one(OUTPUTS, ACTIVATE)
    time.sleep(0.1)
    stopped_at = client.status()[3]
    see.over("left to go", 225 - stopped_at, 0)
    time.sleep(0.2)
    see("it stands", client.status()[3], stopped_at, within=1)


@both("ATR, ADR bits are remembered")
def release_bits(see: See, client: Registers, _: Emulator) -> None:
    for bits in (RELEASE, RELEASE | RELEASE_OPENING, RELEASE_OPENING, 0):
        client.write_one(OUTPUTS, ACTIVATE | bits)
        see("register 1000", client.read(3, OUTPUTS, 1), [ACTIVATE | bits])


@both("other registers: exception 2")
def elsewhere(see: See, client: Registers, _: Emulator) -> None:
    see("read 1500", client.read(4, 1500, 1), "refused 2")
    see("read 2000 to 2003", client.read(4, INPUTS, 4), "refused 2")
    see("write 999", client.write_one(999, 1), "refused 2")
    see("write 2000", client.write(INPUTS, [1]), "refused 2")
    see("and the line goes on", client.read(4, INPUTS, 1)[0] & 0xFF, 0)


@BOTH[0]("other functions: exception 1")
def functions_pymodbus(see: See, client: Registers, _: Emulator) -> None:
    of, answer = {"device_id": SLAVE}, client.answer
    see("function 1", answer(client.client.read_coils(0, count=1, **of)), "refused 1")
    see("function 2", answer(client.client.read_discrete_inputs(0, count=1, **of)), "refused 1")
    see("function 5", answer(client.client.write_coil(0, True, **of)), "refused 1")


@BOTH[0]("function 22, which it has not: exception 1")
def mask_write(see: See, client: Registers, _: Emulator) -> None:
    reply = client.client.mask_write_register(address=OUTPUTS, device_id=SLAVE)
    see("function 22", client.answer(reply), "refused 1")


@BOTH[1]("other functions: exception 1")
def functions_minimalmodbus(see: See, client: Registers, _: Emulator) -> None:
    see("function 1", client.refused(lambda: client.client.read_bit(0, functioncode=1)), "refused 1")
    see("function 2", client.refused(lambda: client.client.read_bit(0, functioncode=2)), "refused 1")
    see("function 5", client.refused(lambda: client.client.write_bit(0, 1, functioncode=5)), "refused 1")


@BOTH[0]("function 23: write and read at once")
def write_read(see: See, client: Registers, _: Emulator) -> None:
    values = [ACTIVATE, 12, 0x3456]
    reply = client.client.readwrite_registers(
        read_address=INPUTS, read_count=3, write_address=OUTPUTS, values=values, device_id=SLAVE
    )
    see("registers read", len(client.answer(reply)), 3)
    see("registers written", client.read(3, OUTPUTS, 3), values)


@BOTH[0]("another slave's number: no answer")
def other_slave(see: See, client: Registers, _: Emulator) -> None:
    see.silence("slave 1", lambda: client.client.read_input_registers(INPUTS, count=1, device_id=1), ModbusIOException)
    see("slave 9", len(client.read(4, INPUTS, 3)), 3)


def pyserial_client(emulator: Emulator) -> serial.Serial:
    return serial.Serial(emulator.address, 115200, timeout=0.5)


of_pyserial = cases.of("pySerial", "robotiq-rtu", pyserial_client)


def exchange(line: serial.Serial, request: str, reply_bytes: int) -> str:
    line.write(bytes.fromhex(request))
    return line.read(reply_bytes).hex(" ")


@of_pyserial("the frames printed in Robotiq's manual")
def frames(see: See, line: serial.Serial, _: Emulator) -> None:
    written = "09 10 03 e8 00 03 01 30"
    see("reset", exchange(line, "09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30", 8), written)
    time.sleep(0.1)
    see("activate", exchange(line, "09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1", 8), written)
    ended = time.monotonic() + 8.0
    reply = ""
    while reply != "09 03 02 31 00 4c 15" and time.monotonic() < ended:
        reply = exchange(line, "09 03 07 D0 00 01 85 CF", 7)
        see.one_of("status", reply, "09 03 02 11 00 55 d5", "09 03 02 31 00 4c 15")
    see("active", reply, "09 03 02 31 00 4c 15")
    see("close", exchange(line, "09 10 03 E8 00 03 06 09 00 00 FF FF FF 42 29", 8), written)


@of_pyserial("a frame with a wrong checksum: no answer, and the line goes on")
def checksum(see: See, line: serial.Serial, _: Emulator) -> None:
    see("wrong", exchange(line, "09 03 07 D0 00 01 85 CE", 7), "")
    see("right", exchange(line, "09 03 07 D0 00 01 85 CF", 7)[:8], "09 03 02")


@of_pyserial("a frame after half of another: answered")
def half(see: See, line: serial.Serial, _: Emulator) -> None:
    line.write(bytes.fromhex("09 03 07"))
    time.sleep(0.2)
    see("whole", exchange(line, "09 03 07 D0 00 01 85 CF", 7)[:8], "09 03 02")
