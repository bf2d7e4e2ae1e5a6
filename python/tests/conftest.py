"""Frames that several tests use: simulated once."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import slipbound

ROOT = Path(__file__).resolve().parents[2]
SCENE = "ramp?object=scissors&force_n=15&ramp_s=0.4&grid=fast&seed=3"


@pytest.fixture(scope="session")
def frames() -> list[slipbound.lab.SimulatedFrame]:
    """Frames of a finger at rest, then pressed, then slipping."""
    return list(slipbound.lab.simulate(SCENE))


@pytest.fixture(scope="session")
def sensor() -> slipbound.Sensor:
    """The finger of these frames."""
    return slipbound.lab.simulate(SCENE).sensor


@pytest.fixture
def monitor(frames: list[slipbound.lab.SimulatedFrame], sensor: slipbound.Sensor) -> slipbound.Monitor:
    """A monitor with a known rest frame."""
    return slipbound.Monitor(sensor, rest=[frame.image() for frame in frames[:5]])


def recordings() -> Iterator[Path]:
    """Recordings that are not part of the project, if present."""
    folder = Path(os.environ.get("SLIPBOUND_DATA", ROOT.parent / "shared" / "data"))
    for kind in ("gelsight-lift", "gelsight-mini-press", "gelslim3-press", "gelsight-mini-wriggle"):
        yield from sorted((folder / kind).rglob("*")) if (folder / kind).is_dir() else ()
