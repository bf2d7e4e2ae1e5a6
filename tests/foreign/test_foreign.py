"""The gripper emulators, tried by clients that do not come from our drivers.

One command, from the root of the repository, after `cargo build --release` and in an environment with
`pip install -r tests/foreign/requirements.txt` (Linux, Python 3.11 or newer; about two minutes):

    pytest -p no:cacheprovider tests/foreign

It prints a table client x command. `--write` writes it to docs/foreign-clients.md. SLIPBOUND=PATH takes another program
than target/release/slipbound. `-k gcl` runs a part. `--wrong N` lets the Nth comparison of each case expect a wrong
value, to see that each can fail: then all must fail that have so many, but for those whose emulator is wrong that way.

Each case starts `slipbound emulate` anew, on a free loopback port or a pseudo-terminal. What is expected is what the
protocol says, so a case fails until its emulator is mended.

| file | what |
|---|---|
| `wsg50_client.py`, `gcl_client.py`, `robotiq_socket_client.py` | clients, written from the protocols |
| `cases_*.py` | what is sent, and what must come |
| `cases.py`, `emulator.py`, `table.py`, `conftest.py` | how it is run and told |
"""

from __future__ import annotations

import cases_gcl  # noqa: F401
import cases_pyrobotiqgripper  # noqa: F401
import cases_robotiq_rtu  # noqa: F401
import cases_robotiq_socket  # noqa: F401
import cases_wsg50  # noqa: F401
import pytest
import table
from cases import CASES, Case, See


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_client(case: Case, pytestconfig: pytest.Config) -> None:
    see = See(pytestconfig.getoption("--wrong"))
    said = "ok"
    try:
        case.run(see)
    except Exception as error:
        said = table.reason(error)
        raise
    finally:
        pytestconfig.stash[table.RESULTS][case] = said
    if see.wrong is not None and see.count < see.wrong:
        pytest.skip(f"has {see.count} comparisons")
