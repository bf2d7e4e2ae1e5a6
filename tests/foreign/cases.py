"""What is tried: one case for each client and command, and how a case compares what came with what should have come."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from emulator import Emulator


def shown(value: object) -> str:
    """A number short enough to read, anything else as it is."""
    return f"{value:.3g}" if isinstance(value, float) else str(value)


class See:
    """Compares. The `wrong`th comparison of a case expects a wrong value, to see that the case can fail."""

    def __init__(self, wrong: int | None = None) -> None:
        self.count = 0
        self.wrong = wrong

    def _is_wrong(self) -> bool:
        self.count += 1
        return self.count == self.wrong

    def __call__(self, what: str, got: object, want: object, within: float | None = None) -> None:
        """What came is what is wanted, numbers to within so much."""
        if self._is_wrong():
            want = want + 1.0 + 2.0 * within if within is not None else ("not", want)
        is_right = got == want if within is None else abs(got - want) <= within
        if not is_right:
            wanted = shown(want) if within is None else f"{shown(want)} within {within}"
            raise AssertionError(f"{what}: expected {wanted}, got {shown(got)}")

    def over(self, what: str, got: float, least: float) -> None:
        """A number is greater than another."""
        if self._is_wrong():
            least = float("inf")
        if not got > least:
            raise AssertionError(f"{what}: expected more than {least}, got {shown(got)}")

    def one_of(self, what: str, got: object, *wanted: object) -> None:
        """What came is one of these."""
        if self._is_wrong():
            wanted = ("not", wanted)
        if got not in wanted:
            raise AssertionError(f"{what}: expected one of {wanted}, got {got}")

    def silence(self, what: str, ask: Callable[[], object], *silent: type[BaseException]) -> None:
        """No answer comes: it raises one of these."""
        is_wrong = self._is_wrong()
        try:
            got = ask()
        except silent:
            got = None
        if (got is None) == is_wrong:
            raise AssertionError(f"{what}: expected {'an' if is_wrong else 'no'} answer, got {got}")


@dataclass(frozen=True)
class Case:
    """One command of one client, with an emulator of its own."""

    client: str
    protocol: str
    command: str
    arguments: tuple[str, ...]
    body: Callable[..., None]
    connect: Callable[[Emulator], object]

    @property
    def name(self) -> str:
        return f"{self.client}: {self.command}"

    def run(self, see: See) -> None:
        with Emulator(self.protocol, *self.arguments) as emulator:
            client = self.connect(emulator)
            with contextlib.closing(client):
                self.body(see, client, emulator)


CASES: list[Case] = []


def of(client: str, protocol: str, connect: Callable[[Emulator], object]) -> Callable[..., Callable]:
    """A decorator for the cases of one client: `@case("HOME", "--width", "0")`."""

    def case(command: str, *arguments: str) -> Callable:
        def keep(body: Callable[..., None]) -> Callable[..., None]:
            CASES.append(Case(client, protocol, command, arguments, body, connect))
            return body

        return keep

    return case


def until(ask: Callable[[], object], wanted: object, timeout_s: float = 8.0) -> list[object]:
    """Asks until the wanted answer comes; all that came, each once in a row."""
    seen = list(_changes(ask, wanted, time.monotonic() + timeout_s))
    if seen[-1] != wanted:
        raise TimeoutError(f"still {seen[-1]} after {timeout_s} s, expected {wanted}")
    return seen


def _changes(ask: Callable[[], object], wanted: object, end: float) -> Iterator[object]:
    last = object()
    while True:
        got = ask()
        if got != last:
            yield got
        last = got
        if got == wanted or time.monotonic() > end:
            return
        time.sleep(0.005)
