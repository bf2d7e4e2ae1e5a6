"""CycloneDDS both ways, and FastDDS as a reader: pictures are published, the node judges them, and every field of every
report is what the library says."""

import dataclasses
import json
import math
import os
import pathlib
import shutil
import subprocess
import time
import types

import pytest
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import int64, uint8, uint64
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from ros_types import Types

ROOT = pathlib.Path(__file__).parent.parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
BINARY = TARGET / "debug" / "slipbound-ros2"
EXAMPLE = TARGET / "debug" / "examples" / "interop_frames"
FASTDDS = TARGET / "ros2-fastdds" / "fastdds_reader"
FASTDDS_CLIENT = TARGET / "ros2-fastdds" / "fastdds_client"
DOMAIN_ID = 98
LONGEST_WAIT_S = 40
REST_COUNT = 20

RELIABLE = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)),
    Policy.History.KeepLast(10),
    Policy.DataRepresentation(use_cdrv0_representation=True),
)

LATCHED = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)),
    Policy.Durability.TransientLocal,
    Policy.History.KeepLast(1),
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
def node(tmp_path, frames, request):
    shutil.copy(frames[2], tmp_path)
    (tmp_path / "hand.toml").write_text(HAND)
    (tmp_path / "node.toml").write_text(getattr(request, "param", "") + NODE)
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


class Cameras:
    """A camera that is a CycloneDDS writer."""

    def __init__(self, participant):
        types = Types()
        self.types = types
        topic = Topic(participant, "rt/left/image/compressed", types("sensor_msgs/CompressedImage"), qos=RELIABLE)
        self.writer = DataWriter(participant, topic, qos=RELIABLE)
        states = Topic(participant, "rt/slipbound/state", types("lifecycle_msgs/State"), qos=LATCHED)
        self.states = DataReader(participant, states, qos=LATCHED)

    def await_active(self):
        """Nothing is published before."""
        until = time.monotonic() + LONGEST_WAIT_S
        while (state := take(self.states, LONGEST_WAIT_S)) is None or state.label != "active":
            assert time.monotonic() < until, "the node is not active"

    def show(self, frames, after_each=lambda i: None):
        jpegs, reports, _ = frames
        first = reports[0]["time_ns"]
        step_ns = reports[1]["time_ns"] - first
        Image, Header, Time = map(
            self.types, ["sensor_msgs/CompressedImage", "std_msgs/Header", "builtin_interfaces/Time"]
        )
        for i, jpeg in enumerate(jpegs):
            if i == REST_COUNT:
                self.await_active()
            ns = reports[i - REST_COUNT]["time_ns"] if i >= REST_COUNT else first - (REST_COUNT - i) * step_ns
            stamp = Time(sec=ns // 10**9, nanosec=ns % 10**9)
            self.writer.write(Image(header=Header(stamp=stamp, frame_id="left_gel"), format="jpeg", data=list(jpeg)))
            if i < REST_COUNT:
                time.sleep(0.03)
            else:
                after_each(i - REST_COUNT)


def await_match(is_matched):
    began = time.monotonic()
    while not is_matched():
        assert time.monotonic() - began < LONGEST_WAIT_S, "the node was not found"
        time.sleep(0.05)
    time.sleep(1.0)  # the other side of the match


def test_every_field_of_every_report_is_what_the_library_says(frames, node):
    reports = frames[1]
    participant = DomainParticipant(DOMAIN_ID)
    cameras = Cameras(participant)

    def reader_of(topic, kind):
        return DataReader(participant, Topic(participant, topic, cameras.types(kind), qos=RELIABLE), qos=RELIABLE)

    reader = reader_of("rt/slipbound/left/report", "slipbound_msgs/SlipReport")
    hand = reader_of("rt/slipbound/hand/report", "slipbound_msgs/HandReport")
    await_match(lambda: cameras.writer.get_matched_subscriptions() and reader.get_matched_publications())
    compared = []

    def compare(i):
        got = take(reader, LONGEST_WAIT_S)
        assert got is not None, f"no report of picture {i}"
        assert differences(got, reports[i]) == []
        compared.append(i)

    cameras.show(frames, compare)
    assert len(compared) == len(reports)
    states = {report["state"] for report in reports}
    assert {"no_contact", "stick", "incipient"} <= states, states
    hands = [take(hand, LONGEST_WAIT_S)] + hand.take(100)
    assert hands[0].health == ["live", "absent", "absent", "absent"] and hands[0].header.frame_id == "hand"
    assert "incipient" in {report.state for report in hands}


def service_type(name, fields):
    """A request or an answer as rmw_cyclonedds_cpp puts it on the wire: 16 bytes say whose it is and which, then the payload."""
    fields = [("guid", uint64), ("seq", int64), *fields]
    body = lambda namespace: namespace.update(__annotations__=dict(fields), __module__=__name__)
    return dataclasses.dataclass(types.new_class(name.split("::")[-1], (IdlStruct,), {"typename": name}, body))


class Service:
    """A client that is a pair of CycloneDDS endpoints."""

    def __init__(self, participant, service, kind, answer):
        package, name = kind.split("/")
        self.request = service_type(f"{package}::srv::dds_::{name}_Request_", [("structure_needs_at_least_one_member", uint8)])
        response = service_type(f"{package}::srv::dds_::{name}_Response_", answer)
        requests = Topic(participant, f"rq/slipbound/{service}Request", self.request, qos=RELIABLE)
        answers = Topic(participant, f"rr/slipbound/{service}Reply", response, qos=RELIABLE)
        self.writer = DataWriter(participant, requests, qos=RELIABLE)
        self.reader = DataReader(participant, answers, qos=RELIABLE)

    def is_matched(self):
        return self.writer.get_matched_subscriptions() and self.reader.get_matched_publications()

    def ask(self, guid, seq):
        self.writer.write(self.request(guid=guid, seq=seq, structure_needs_at_least_one_member=0))
        answer = take(self.reader, LONGEST_WAIT_S)
        assert answer is not None, "no answer"
        assert (answer.guid, answer.seq) == (guid, seq), "an answer to somebody else"
        return answer


@pytest.mark.parametrize("node", ['service_mapping = "cyclone"\n'], indirect=True)
def test_services_answer_cyclonedds_in_its_mapping(node):
    participant = DomainParticipant(DOMAIN_ID)
    state = Service(participant, "get_state", "lifecycle_msgs/GetState", [("id", uint8), ("label", str)])
    tare = Service(participant, "tare", "std_srvs/Trigger", [("success", bool), ("message", str)])
    await_match(lambda: state.is_matched() and tare.is_matched())
    for seq in (1, 2, 1 << 40):
        answer = state.ask(0x0123456789ABCDEF, seq)
        assert (answer.id, answer.label) == (1, "unconfigured")
    answer = tare.ask(0xFEDCBA9876543210, 3)
    assert not answer.success and "left" in answer.message


@pytest.mark.skipif(not FASTDDS_CLIENT.exists(), reason="fastdds_client is not built (ros2/check.sh builds it)")
def test_services_answer_fastdds_in_the_enhanced_mapping(node):
    def ask(service, kind):
        args = [FASTDDS_CLIENT, str(DOMAIN_ID), service, kind]
        done = subprocess.run(args, capture_output=True, text=True, timeout=2 * LONGEST_WAIT_S, check=True)
        return bytes.fromhex(done.stdout)[4:]  # behind how it is encoded

    state = ask("slipbound/get_state", "lifecycle_msgs::srv::dds_::GetState")
    assert state[0] == 1 and b"unconfigured\0" in state
    tare = ask("slipbound/tare", "std_srvs::srv::dds_::Trigger")
    assert tare[0] == 0 and b"left: expected a finger at rest" in tare


def test_a_difference_is_found():
    Time = Types()("builtin_interfaces/Time")
    assert differences(Time(sec=1, nanosec=2), {"sec": 1, "nanosec": 2}) == []
    assert differences(Time(sec=1, nanosec=2), {"sec": 1, "nanosec": 3}) == [".nanosec: 2, expected 3"]
    assert differences(Time(sec=1, nanosec=2), {"nanosec": 2, "sec": 1}) != []


@pytest.mark.skipif(not FASTDDS.exists(), reason="fastdds_reader is not built (ros2/check.sh builds it)")
def test_fastdds_reads_every_field_the_same(frames, node):
    reports = frames[1]
    args = [FASTDDS, str(DOMAIN_ID), "slipbound/left/report", str(len(reports))]
    reader = subprocess.Popen(args, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        participant = DomainParticipant(DOMAIN_ID)
        cameras = Cameras(participant)
        assert reader.stderr.readline() == "matched 1\n"
        await_match(cameras.writer.get_matched_subscriptions)
        cameras.show(frames, lambda i: time.sleep(0.1))
        out, _ = reader.communicate(timeout=LONGEST_WAIT_S)
    finally:
        reader.kill()
        reader.wait()
    assert [json.loads(line) for line in out.splitlines()] == reports
