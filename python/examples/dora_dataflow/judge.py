"""A node that judges the pictures of one finger: pictures in, reports out as the JSON of ``slipbound watch --json``."""

from __future__ import annotations

import os

import pyarrow as pa
from dora import Node

import slipbound

SCENE = "ramp?object=scissors&rest_frames=24&ramp_s=0.4&grid=fast&seed=3"


def main() -> None:
    """Judge until the camera ends; the finger at rest is found among the first pictures."""
    # With a camera of your own: the name of your finger, or your finger.toml.
    sensor = slipbound.lab.simulate(os.environ.get("SCENE", SCENE)).sensor
    monitor = slipbound.Monitor(sensor, rest="auto")
    node = Node()
    for event in node:
        if event["type"] == "STOP":
            break
        if event["type"] != "INPUT":
            continue
        told = event["metadata"]
        # No copy: the array is the memory that both processes share.
        image = event["value"].to_numpy(zero_copy_only=True).reshape(told["height"], told["width"], 3)
        report = monitor.step(image, time_ns=told["time_ns"])
        node.send_output("report", pa.array([report.to_json()]))


if __name__ == "__main__":
    main()
