"""A TCP connection whose bytes gather until a message is whole."""

from __future__ import annotations

import socket
import time


class TcpLink:
    """What clients of a gripper share: the connection, and `pending`, what came and was not read yet."""

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.create_connection((host, port), timeout=5.0)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.pending = b""

    def more(self, end_s: float, timeout_s: float) -> None:
        """Waits until `end_s` at most for the next bytes; `timeout_s` is for the message."""
        left = end_s - time.monotonic()
        if left <= 0.0:
            raise TimeoutError(f"no answer for {timeout_s} s, {self.pending!r} came")
        self.socket.settimeout(left)
        try:
            data = self.socket.recv(4096)
        except TimeoutError:
            return
        if not data:
            raise ConnectionError("the gripper closed the connection")
        self.pending += data

    def close(self) -> None:
        self.socket.close()
