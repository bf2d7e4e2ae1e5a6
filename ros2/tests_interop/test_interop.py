"""CycloneDDS and FastDDS both ways: pictures are published, the node judges them, and every field of every report is what the
library says."""

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
FASTDDS_WRITER = TARGET / "ros2-fastdds" / "fastdds_writer"
FASTDDS_CLIENT = TARGET / "ros2-fastdds" / "fastdds_client"
DOMAIN_ID = 98
LONGEST_WAIT_S = 40
REST_COUNT = 20

RELIABLE = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)),
    Policy.History.KeepLast(10),
    Policy.DataRepresentation(use_cdrv0_representation=True),
)

SENSOR_DATA = Qos(
    Policy.Reliability.BestEffort,
    Policy.History.KeepLast(100),
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
    """JPEG files in order, and what the library says of those after the rest frames."""
    folder = tmp_path_factory.mktemp("frames")
    subprocess.run([EXAMPLE, folder], check=True, stdout=subprocess.DEVNULL)
    jpegs = sorted(folder.glob("*.jpg"))
    reports, hands = (
        [json.loads(line) for line in (folder / name).read_text().splitlines()] for name in ("reports.jsonl", "hands.jsonl")
    )
    assert len(jpegs) == len(reports) + REST_COUNT and len(reports) == len(hands) > 20
    return types.SimpleNamespace(jpegs=jpegs, reports=reports, hands=hands, sensor=folder / "sensor.toml")


@pytest.fixture
def node(tmp_path, frames, request):
    shutil.copy(frames.sensor, tmp_path)
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


class CycloneCamera:
    """A camera that is a CycloneDDS writer."""

    def __init__(self, participant):
        self.types = types = Types()
        topic = Topic(participant, "rt/left/image/compressed", types("sensor_msgs/CompressedImage"), qos=RELIABLE)
        self.writer = DataWriter(participant, topic, qos=RELIABLE)

    def is_matched(self):
        return self.writer.get_matched_subscriptions()

    def publish(self, stamp, jpeg):
        Image, Header = map(self.types, ["sensor_msgs/CompressedImage", "std_msgs/Header"])
        data = list(jpeg.read_bytes())
        self.writer.write(Image(header=Header(stamp=stamp, frame_id="left_gel"), format="jpeg", data=data))

    def close(self):
        pass


class FastddsCamera:
    """A camera that is a FastDDS writer, which publishes the files that it is told of."""

    def __init__(self, _participant):
        args = [FASTDDS_WRITER, str(DOMAIN_ID), "left/image/compressed", "left_gel"]
        self.process = subprocess.Popen(args, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def is_matched(self):
        return self.process.stderr.readline() == "matched 1\n"

    def publish(self, stamp, jpeg):
        print(stamp.sec, stamp.nanosec, jpeg, file=self.process.stdin, flush=True)

    def close(self):
        self.process.kill()
        self.process.wait()


class Node:
    """What the node publishes, and the pictures for it."""

    def __init__(self, participant, camera):
        self.participant, self.camera, self.types = participant, camera, Types()
        self.states = self.reader("state", "lifecycle_msgs/State", LATCHED)

    def reader(self, topic, kind, qos=RELIABLE):
        name = f"rt{topic}" if topic.startswith("/") else f"rt/slipbound/{topic}"
        return DataReader(self.participant, Topic(self.participant, name, self.types(kind), qos=qos), qos=qos)

    def await_active(self):
        """Nothing is published before."""
        until = time.monotonic() + LONGEST_WAIT_S
        while (state := take(self.states, LONGEST_WAIT_S)) is None or state.label != "active":
            assert time.monotonic() < until, "the node is not active"

    def show(self, frames, after_each=lambda i: None):
        first = frames.reports[0]["time_ns"]
        step_ns = frames.reports[1]["time_ns"] - first
        Time = self.types("builtin_interfaces/Time")
        for i, jpeg in enumerate(frames.jpegs):
            if i == REST_COUNT:
                self.await_active()
            ns = frames.reports[i - REST_COUNT]["time_ns"] if i >= REST_COUNT else first - (REST_COUNT - i) * step_ns
            self.camera.publish(Time(sec=ns // 10**9, nanosec=ns % 10**9), jpeg)
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


fastdds_writer = pytest.mark.skipif(
    not FASTDDS_WRITER.exists(), reason="fastdds_writer is not built (ros2/check.sh builds it)"
)


@pytest.mark.parametrize("node", ["overlay = true\n"], indirect=True)
@pytest.mark.parametrize("camera", [CycloneCamera, pytest.param(FastddsCamera, marks=fastdds_writer)])
def test_every_field_of_every_report_is_what_the_library_says(frames, node, camera):
    reports = frames.reports
    participant = DomainParticipant(DOMAIN_ID)
    camera = camera(participant)
    node = Node(participant, camera)
    reader = node.reader("left/report", "slipbound_msgs/SlipReport")
    hand = node.reader("hand/report", "slipbound_msgs/HandReport")
    wrench = node.reader("left/wrench", "geometry_msgs/WrenchStamped", SENSOR_DATA)
    overlay = node.reader("left/overlay/compressed", "sensor_msgs/CompressedImage", SENSOR_DATA)
    diagnostics = node.reader("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    try:
        await_match(lambda: camera.is_matched() and reader.get_matched_publications())
        hands, wrenches, overlays, compared = [], [], [], []

        def compare(i):
            got = take(reader, LONGEST_WAIT_S)
            assert got is not None, f"no report of picture {i}"
            assert differences(got, reports[i]) == []
            compared.append(i)
            hands.extend(hand.take(100))
            wrenches.extend(wrench.take(100))
            overlays.extend(overlay.take(100))

        node.show(frames, compare)
        hands.append(take(hand, LONGEST_WAIT_S))
        status = last_status(diagnostics, len(reports))
    finally:
        camera.close()
    assert len(compared) == len(reports)
    states = {report["state"] for report in reports}
    assert {"no_contact", "stick", "incipient"} <= states, states
    compare_hands(hands, frames.hands)
    compare_wrenches(wrenches, reports)
    stamps = {(r["header"]["stamp"]["sec"], r["header"]["stamp"]["nanosec"]) for r in reports}
    assert overlays
    for picture in overlays:
        data = bytes(picture.data)
        assert picture.format == "jpeg" and data[:2] == b"\xff\xd8" and data[-2:] == b"\xff\xd9" and len(data) <= 64000
        assert (picture.header.stamp.sec, picture.header.stamp.nanosec) in stamps and picture.header.frame_id == "left_gel"
    assert (status.name, status.hardware_id) == ("slipbound: left", "A")
    values = {value.key: value.value for value in status.values}
    assert (values["lifecycle"], values["state"]) == ("active", reports[-1]["state"])
    counts = {key: int(value) for key, value in values.items() if key.endswith("_count")}
    assert (counts.pop("received_count"), counts.pop("reports_count")) == (len(frames.jpegs), len(reports))
    assert not any(counts.values()), counts


def last_status(diagnostics, reports_count):
    """The status of the finger once that many reports were published."""
    until = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < until:
        (status,) = take(diagnostics, LONGEST_WAIT_S).status
        if any((value.key, value.value) == ("reports_count", str(reports_count)) for value in status.values):
            return status
    raise AssertionError("no diagnostics of all reports")


def compare_hands(hands, expected):
    """Without a picture for a tenth of a second, as on a busy computer, the hand is blind in between."""
    by_seq = {report["seq"]: report for report in expected}
    hands = [report for report in hands if report.health[0] != "blind"]
    for report in hands:
        assert differences(report, by_seq[report.seq]) == []
    compared = {report.seq for report in hands}
    assert len(compared) > len(expected) / 2, f"{len(compared)} of {len(expected)}"
    assert "incipient" in {report.state for report in hands}


def compare_wrenches(wrenches, reports):
    """Each is what the report of the same picture says (docs/ros2.md), and there is one where that is known; best effort loses few."""
    by_stamp = {tuple(report["header"]["stamp"].values()): report for report in reports}
    known = {at for at, report in by_stamp.items() if None not in (report["shear_n"]["value"], report["torque_nmm"]["value"])}
    seen = set()
    for message in wrenches:
        at = (message.header.stamp.sec, message.header.stamp.nanosec)
        report, force, torque = by_stamp[at], message.wrench.force, message.wrench.torque
        assert at in known and message.header.frame_id == "left_gel"
        x, y = report["shear"]["translation_px"]
        newtons = report["shear_n"]["value"] / (math.hypot(x, y) or 1.0)
        assert (force.x, force.y) == pytest.approx((newtons * x, newtons * y), rel=1e-12)
        assert math.isnan(force.z) and report["grip_n"] is None
        assert (torque.x, torque.y) == (0.0, 0.0)
        assert torque.z == pytest.approx(report["torque_nmm"]["value"] * 1e-3, rel=1e-12)
        seen.add(at)
    assert len(seen) > len(known) / 2 > 0, f"{len(seen)} of {len(known)}"


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
    reports = frames.reports
    args = [FASTDDS, str(DOMAIN_ID), "slipbound/left/report", str(len(reports))]
    reader = subprocess.Popen(args, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        participant = DomainParticipant(DOMAIN_ID)
        camera = CycloneCamera(participant)
        assert reader.stderr.readline() == "matched 1\n"
        await_match(camera.is_matched)
        Node(participant, camera).show(frames, lambda i: time.sleep(0.1))
        out, _ = reader.communicate(timeout=LONGEST_WAIT_S)
    finally:
        reader.kill()
        reader.wait()
    assert [json.loads(line) for line in out.splitlines()] == reports
