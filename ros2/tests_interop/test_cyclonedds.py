"""CycloneDDS both ways: it publishes pictures, the node judges them, and every field of every report is the library's."""

import json
import math
import os
import pathlib
import shutil
import subprocess
import time

import pytest
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from ros_types import Types

ROOT = pathlib.Path(__file__).parent.parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
BINARY = TARGET / "debug" / "slipbound-ros2"
EXAMPLE = TARGET / "debug" / "examples" / "interop_frames"
DOMAIN_ID = 98
LONGEST_WAIT_S = 40
REST_COUNT = 20

RELIABLE = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)),
    Policy.History.KeepLast(10),
    Policy.DataRepresentation(use_cdrv0_representation=True),
)

HAND = 'name = "one"\n[[fingers]]\nname = "left"\nserial = "A"\nside = "left"\nsensor = "sensor.toml"\n'
NODE = (
    f'hand = "hand.toml"\ndomain_id = {DOMAIN_ID}\nimage_qos = "reliable"\n'
    '[[fingers]]\nname = "left"\nimage_topic = "/left/image/compressed"\n'
)


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """JPEGs in order, and what the library says of those after the rest frames."""
    folder = tmp_path_factory.mktemp("frames")
    subprocess.run([EXAMPLE, folder], check=True, stdout=subprocess.DEVNULL)
    jpegs = [path.read_bytes() for path in sorted(folder.glob("*.jpg"))]
    reports = [json.loads(line) for line in (folder / "reports.jsonl").read_text().splitlines()]
    assert len(jpegs) == len(reports) + REST_COUNT and len(reports) > 20
    return jpegs, reports, folder / "sensor.toml"


@pytest.fixture
def node(tmp_path, frames):
    shutil.copy(frames[2], tmp_path)
    (tmp_path / "hand.toml").write_text(HAND)
    (tmp_path / "node.toml").write_text(NODE)
    process = subprocess.Popen([BINARY, "node", tmp_path / "node.toml"], stdout=subprocess.DEVNULL)
    yield process
    process.kill()
    process.wait()


def take(reader, longest_s):
    until = time.monotonic() + longest_s
    while True:
        samples = reader.take(1)
        if samples:
            return samples[0]
        if time.monotonic() >= until:
            return None
        time.sleep(0.002)


def differences(got, expected, path=""):
    """Where a message and a line of JSON differ; None there is NaN here. Numbers are compared to the last bit."""
    if isinstance(expected, dict):
        names = [field for field in got.__dataclass_fields__]
        if names != list(expected):
            return [f"{path}: fields {names}, expected {list(expected)}"]
        return [d for name in names for d in differences(getattr(got, name), expected[name], f"{path}.{name}")]
    if isinstance(expected, list):
        return [d for i, (a, b) in enumerate(zip(got, expected, strict=True)) for d in differences(a, b, f"{path}[{i}]")]
    if expected is None:
        return [] if math.isnan(got) else [f"{path}: {got}, expected NaN"]
    return [] if got == expected else [f"{path}: {got!r}, expected {expected!r}"]


def test_every_field_of_every_report_is_what_the_library_says(frames, node):
    jpegs, reports, _ = frames
    types = Types()
    Image, Header, Time = types("sensor_msgs/CompressedImage"), types("std_msgs/Header"), types("builtin_interfaces/Time")
    participant = DomainParticipant(DOMAIN_ID)
    images = DataWriter(participant, Topic(participant, "rt/left/image/compressed", Image, qos=RELIABLE), qos=RELIABLE)
    topic = Topic(participant, "rt/slipbound/left/report", types("slipbound_msgs/SlipReport"), qos=RELIABLE)
    reader = DataReader(participant, topic, qos=RELIABLE)
    began = time.monotonic()
    while not (images.get_matched_subscriptions() and reader.get_matched_publications()):
        assert time.monotonic() - began < LONGEST_WAIT_S, "the node was not found"
        time.sleep(0.05)
    time.sleep(1.0)  # the node's side of the match

    first = reports[0]["time_ns"]
    step_ns = reports[1]["time_ns"] - first
    offset = None
    compared = 0
    for i, jpeg in enumerate(jpegs):
        ns = reports[i - REST_COUNT]["time_ns"] if i >= REST_COUNT else first - (REST_COUNT - i) * step_ns
        stamp = Time(sec=ns // 10**9, nanosec=ns % 10**9)
        images.write(Image(header=Header(stamp=stamp, frame_id="left_gel"), format="jpeg", data=list(jpeg)))
        if i < REST_COUNT:
            time.sleep(0.03)
            continue
        got = take(reader, LONGEST_WAIT_S)
        assert got is not None, f"no report of picture {i}"
        expected = reports[i - REST_COUNT]
        assert differences(got, expected) == []
        compared += 1
    assert compared == len(reports)
    states = {report["state"] for report in reports}
    assert {"no_contact", "incipient"} <= states, states
