"""Options of the test, and the table that it makes."""

from __future__ import annotations

import pytest
import table


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--write", action="store_true", help="write the table to docs/foreign-clients.md")
    parser.addoption(
        "--wrong", type=int, metavar="N", help="let the Nth comparison of each case expect a wrong value: all must fail"
    )


def pytest_configure(config: pytest.Config) -> None:
    config.stash[table.RESULTS] = {}


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    results = config.stash[table.RESULTS]
    if config.getoption("--wrong") is not None or not results:
        return
    terminalreporter.section("client x command")
    terminalreporter.write(table.text(results))
    if config.getoption("--write"):
        terminalreporter.line(table.write(results))
