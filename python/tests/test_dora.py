"""The dataflow of examples/dora_dataflow, by dora itself: camera, slipbound and gripper as three processes."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import slipbound
from conftest import ROOT

pytest.importorskip("dora", reason="dora-rs is not installed")
SCENE = "ramp?object=scissors&rest_frames=24&ramp_s=0.4&grid=fast&seed=3"


@pytest.mark.skipif(shutil.which("dora", path=str(Path(sys.executable).parent)) is None, reason="dora-rs-cli is not installed")
def test_every_report_of_the_dataflow_is_that_of_a_monitor(tmp_path):
    flow = tmp_path / "flow"
    shutil.copytree(ROOT / "python" / "examples" / "dora_dataflow", flow)
    reports = tmp_path / "reports.jsonl"
    # dora starts the nodes with the first `python` in PATH.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    env = {**os.environ, "PATH": path, "SCENE": SCENE, "REPORTS": str(reports)}
    done = subprocess.run(
        ["dora", "run", "dataflow.yml"], cwd=flow, env=env, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    simulation = slipbound.lab.simulate(SCENE)
    monitor = slipbound.Monitor(simulation.sensor, rest="auto")
    expected = [monitor.step(frame.image(), time_ns=frame.time_ns).to_json() for frame in simulation]
    assert reports.read_text().splitlines() == expected
    assert f"{len(expected)} reports, still holding with 12.0 N" in done.stdout + done.stderr
