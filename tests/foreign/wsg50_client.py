"""A client of the WSG-50's binary command interface, written from the protocol alone.

A frame, numbers with the low byte first; N counts the payload:

    AA AA AA | id, 1 byte | N, 2 bytes | payload, N bytes | CRC, 2 bytes

A reply's payload starts with a status of 2 bytes. A motion is answered twice: at once with status 26, and at its end.
"""

from __future__ import annotations

import struct
import time
from dataclasses import dataclass

from tcp_link import TcpLink

PREAMBLE = b"\xaa\xaa\xaa"

DISCONNECT, HOME, MOVE, STOP, FAST_STOP, ACKNOWLEDGE, GRASP, RELEASE = 0x07, 0x20, 0x21, 0x22, 0x23, 0x24, 0x25, 0x26
SET_ACCELERATION, GET_ACCELERATION, SET_FORCE, GET_FORCE, TARE = 0x30, 0x31, 0x32, 0x33, 0x38
SYSTEM_STATE, GRASP_STATE, OPENING, SPEED, FORCE = 0x40, 0x41, 0x43, 0x44, 0x45

OK, NOT_INITIALIZED, UNKNOWN_COMMAND, ACCESS_DENIED, FAILED, ABORTED = 0, 3, 14, 16, 18, 19
PENDING, OUT_OF_RANGE, AXIS_BLOCKED = 26, 28, 29

IDLE, GRASPING, NO_PART, PART_LOST, HOLDING, RELEASING, POSITIONING, ERROR = range(8)

# Bits of the system state.
REFERENCED, MOVING, BLOCKED_CLOSING = 1 << 0, 1 << 1, 1 << 2
AXIS_STOPPED, TARGET_REACHED, FAST_STOPPED = 1 << 6, 1 << 7, 1 << 12

# Flags of MOVE.
RELATIVE, STOP_ON_BLOCK = 1 << 0, 1 << 1


def _table() -> list[int]:
    """The table of the polynomial 0x1021 with the high bit first."""
    table = []
    for index in range(256):
        crc = index << 8
        for _ in range(8):
            crc = ((crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
        table.append(crc)
    return table


TABLE = _table()


def crc(data: bytes) -> int:
    """Shifts to the right through the table of the left shift, as the gripper does. With its own CRC behind: 0."""
    value = 0xFFFF
    for byte in data:
        value = TABLE[(value ^ byte) & 0xFF] ^ (value >> 8)
    return value


def frame(command: int, payload: bytes = b"") -> bytes:
    """What goes over the line for a command."""
    head = PREAMBLE + bytes([command]) + struct.pack("<H", len(payload)) + payload
    return head + struct.pack("<H", crc(head))


@dataclass
class Reply:
    """What came for one command."""

    command: int
    status: int
    payload: bytes

    def f32(self) -> float:
        return struct.unpack("<f", self.payload)[0]

    def u8(self) -> int:
        return struct.unpack("<B", self.payload)[0]

    def u32(self) -> int:
        return struct.unpack("<I", self.payload)[0]


class Wsg50(TcpLink):
    """A connection to the gripper."""

    def send(self, command: int, payload: bytes = b"") -> None:
        self.socket.sendall(frame(command, payload))

    def receive(self, timeout_s: float = 2.0) -> Reply:
        """The next frame, whatever it answers."""
        end = time.monotonic() + timeout_s
        while True:
            if len(self.pending) >= 8:
                length = struct.unpack("<H", self.pending[4:6])[0]
                if len(self.pending) >= 8 + length:
                    whole, self.pending = self.pending[: 8 + length], self.pending[8 + length :]
                    if whole[:3] != PREAMBLE or crc(whole) != 0:
                        raise ValueError(f"no frame: {whole.hex(' ')}")
                    return Reply(whole[3], struct.unpack("<H", whole[6:8])[0], whole[8:-2])
            self.more(end, timeout_s)

    def answer(self, command: int, timeout_s: float = 2.0) -> Reply:
        """The next frame that belongs to a command; others are passed over."""
        end = time.monotonic() + timeout_s
        while True:
            reply = self.receive(max(0.0, end - time.monotonic()))
            if reply.command == command:
                return reply

    def ask(self, command: int, payload: bytes = b"", timeout_s: float = 2.0) -> Reply:
        """A command that is answered once."""
        self.send(command, payload)
        return self.answer(command, timeout_s)

    def motion(self, command: int, payload: bytes, timeout_s: float = 8.0) -> list[int]:
        """The statuses of a motion, to the one that ends it."""
        self.send(command, payload)
        statuses = [self.answer(command, timeout_s).status]
        while statuses[-1] == PENDING:
            statuses.append(self.answer(command, timeout_s).status)
        return statuses

    def home(self, direction: int = 0) -> list[int]:
        """Direction: 0 as configured, 1 towards open, 2 towards closed."""
        return self.motion(HOME, bytes([direction]))

    def move(self, width_mm: float, speed_mm_per_s: float, flags: int = 0) -> list[int]:
        """Flags: bit 0 relative, bit 1 stop when blocked instead of clamping."""
        return self.motion(MOVE, struct.pack("<Bff", flags, width_mm, speed_mm_per_s))

    def grasp(self, width_mm: float, speed_mm_per_s: float) -> list[int]:
        return self.motion(GRASP, struct.pack("<ff", width_mm, speed_mm_per_s))

    def release(self, width_mm: float, speed_mm_per_s: float) -> list[int]:
        return self.motion(RELEASE, struct.pack("<ff", width_mm, speed_mm_per_s))

    def set_f32(self, command: int, value: float) -> int:
        return self.ask(command, struct.pack("<f", value)).status

    def get_f32(self, command: int) -> float:
        """Of acceleration or force limit, which are asked for without a payload."""
        reply = self.ask(command)
        if reply.status != OK:
            raise ValueError(f"command 0x{command:02X}: status {reply.status}")
        return reply.f32()

    def state(self, command: int, period_ms: int = 0, flags: int = 0) -> Reply:
        """A state, once (flags 0), or by itself every period (bit 0), then only if it changed (bit 1)."""
        return self.ask(command, struct.pack("<BH", flags, period_ms))

    def acknowledge(self) -> int:
        return self.ask(ACKNOWLEDGE, b"ack").status

    def leave(self) -> int:
        """Tells the gripper before the connection is closed, so that no fast stop latches."""
        status = self.ask(DISCONNECT).status
        self.socket.close()
        return status
