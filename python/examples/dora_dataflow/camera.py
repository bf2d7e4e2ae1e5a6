"""A node that stands for your camera: a simulated finger at rest, pressed and pulled, 30 pictures a second."""

from __future__ import annotations

import os

import pyarrow as pa
from dora import Node

import slipbound

SCENE = "ramp?object=scissors&rest_frames=24&ramp_s=0.4&grid=fast&seed=3"


def main() -> None:
    """Send pictures as flat uint8 arrays, B G R; their shape and time are in the metadata."""
    node = Node()
    for frame in slipbound.lab.simulate(os.environ.get("SCENE", SCENE)):
        # Paces the pictures; a camera of your own does that itself.
        event = node.next(timeout=1 / 30)
        if event is not None and event["type"] == "STOP":
            break
        image = frame.image()
        height, width, _ = image.shape
        metadata = {"height": height, "width": width, "encoding": "bgr8", "time_ns": frame.time_ns}
        node.send_output("image", pa.array(image.reshape(-1)), metadata)


if __name__ == "__main__":
    main()
