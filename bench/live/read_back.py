"""Recordings read by others, and others' by us.

1. slipbound records a simulated scene with --record; PyPI's mcap and mcap-protobuf-support read every picture, every frame
   record and every report, and count and compare them with the JSON lines; so with the lines drawn over the pictures, of
   which there are three for every marker found, and the layout names topics that are there.
2. The same recording, written again by PyPI's mcap with its chunks compressed by zstd and by lz4, is judged to the same lines.
3. PyPI's rosbags writes ROS 2 CompressedImage and Image messages into an MCAP bag and one in SQLite; slipbound watches them to the same reports
   as the folder with the same pictures.
4. A stream is recorded, and `record` is killed with -9; PyPI's mcap reads what is there, by time, as it does by default.

    python3 bench/live/read_back.py [path of the program slipbound]
"""

import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer as McapWriter
from mcap_protobuf.decoder import DecoderFactory

PROGRAM = str(Path(sys.argv[1] if len(sys.argv) > 1 else "target/release/slipbound").resolve())


def slipbound(folder, *args):
    ended = subprocess.run([PROGRAM, *args], cwd=folder, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, f"{args}: {ended.returncode}: {ended.stderr}"
    return ended.stdout


def lines(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def ours(folder):
    slipbound(folder, "simulate", "ramp", "--seed", "3", "-o", "scene")
    slipbound(folder, "watch", "scene", "--sensor", "scene/sensor.toml", "--json", "scene.jsonl", "--record", "run.mcap")
    report = lines(folder / "scene.jsonl")
    pictures, frames, reports = [], [], []
    with open(folder / "run.mcap", "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(topics=["/finger/camera"]):
            assert message.format == "jpeg", message.format
            assert message.frame_id == "finger", message.frame_id
            pictures.append(bytes(message.data))
        for _, channel, message in reader.iter_messages(topics=["/finger/frame", "/finger/report"]):
            (frames if channel.topic == "/finger/frame" else reports).append(json.loads(message.data))
        annotated = [message for *_, message in reader.iter_decoded_messages(topics=["/finger/annotations"])]
        topics = {channel.topic for channel in reader.get_summary().channels.values()}
        attachments = sorted(a.name for a in reader.iter_attachments())
        schemas = {s.name: s.encoding for s in reader.get_summary().schemas.values()}
    files = sorted(p for p in (folder / "scene").glob("*") if p.suffix in (".jpg", ".png"))
    assert [f.read_bytes() for f in files] == pictures, "pictures are the files' bytes"
    assert len(frames) == len(pictures) and all(f["fate"] == "judged" and f["is_kept"] for f in frames), frames[:3]
    assert reports == report, "reports are the JSON lines"
    assert attachments == ["finger.sensor.toml", "settings.toml"], attachments
    assert schemas["foxglove.CompressedImage"] == "protobuf" and schemas["slipbound.Report"] == "jsonschema", schemas
    slipbound(folder, "watch", "run.mcap", "--sensor", "scene/sensor.toml", "--json", "again.jsonl")
    assert lines(folder / "again.jsonl")[1:] == report[1:], "judged again to the same"
    annotations(annotated, report[1:])
    layout = (Path(__file__).parent / "../../docs/foxglove-layout.json").read_text()
    assert all(topic.replace("/finger/", "/left/") in layout for topic in topics - {"/finger/frame"}), topics
    packed(folder, report)
    print(f"read by mcap: {len(pictures)} pictures, {len(frames)} frame records, {len(reports)} report lines, all equal")
    return files, report


def annotations(annotated, report):
    assert len(annotated) == len(report), f"{len(annotated)} annotations of {len(report)} frames"
    arrows = slips = 0
    for message, line in zip(annotated, report, strict=True):
        moved, slipping = message.points
        assert moved.type == slipping.type == 4 and not message.circles, "lists of lines"
        stamp_ns = moved.timestamp.seconds * 10**9 + moved.timestamp.nanos
        # Frames without a time have that of their arrival.
        assert line["time_ns"] in (None, stamp_ns), "the picture's own time"
        assert len(moved.points) == 6 * line["markers"]["matched"], "three lines a marker"
        # A report counts the markers that were found and those that are coasted; lines are of those found.
        assert len(slipping.points) <= 6 * line["slip"]["markers_over"] and len(slipping.points) % 6 == 0
        assert [text.text for text in message.texts] == [WORDS.get(line["state"], message.texts[0].text)]
        arrows, slips = arrows + len(moved.points) // 6, slips + len(slipping.points) // 6
    assert slips > 0, "a ramp slips"
    print(f"annotations: {len(annotated)} messages, {arrows} arrows of motion, {slips} of slip")


WORDS = {"no_contact": "no contact", "unsure": "unsure", "stick": "stick", "incipient": "incipient slip", "gross": "gross slip"}


def packed(folder, report):
    """Written again by PyPI's mcap with compressed chunks."""
    for compression in (CompressionType.ZSTD, CompressionType.LZ4):
        name = f"{compression.name.lower()}.mcap"
        with open(folder / "run.mcap", "rb") as file, open(folder / name, "wb") as to:
            reader, writer = make_reader(file), McapWriter(to, compression=compression, chunk_size=200_000)
            writer.start()
            schemas, channels = {}, {}
            for schema, channel, message in reader.iter_messages(log_time_order=False):
                if schema.id not in schemas:
                    schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
                if channel.id not in channels:
                    channels[channel.id] = writer.register_channel(
                        channel.topic, channel.message_encoding, schemas[schema.id]
                    )
                writer.add_message(
                    channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
                )
            writer.finish()
        with open(folder / name, "rb") as file:
            chunks = make_reader(file).get_summary().chunk_indexes
        assert len(chunks) > 2 and all(chunk.compression == compression.name.lower() for chunk in chunks), chunks
        slipbound(folder, "watch", name, "--sensor", "scene/sensor.toml", "--json", "packed.jsonl")
        assert lines(folder / "packed.jsonl")[1:] == report[1:], f"{name}: judged to the same"
        print(f"{name}, written by mcap: {len(chunks)} chunks, {len(report) - 1} report lines equal")


def ros(folder, files, report):
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    header = lambda at: types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](sec=100 + at // 25, nanosec=at % 25 * 40_000_000), frame_id="finger"
    )
    for plugin in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
        bag(folder / plugin.name, plugin, store, header, files)
    for file in [next((folder / "MCAP").glob("*.mcap")), next((folder / "SQLITE3").glob("*.db3"))]:
        watched(folder, file, files, report)


def bag(folder, plugin, store, header, files):
    import numpy
    from rosbags.rosbag2 import Writer

    types = store.types
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        kind = "sensor_msgs/msg/CompressedImage"
        topic = writer.add_connection("/finger/image/compressed", kind, typestore=store)
        grey_kind = "sensor_msgs/msg/Image"
        grey_topic = writer.add_connection("/grey", grey_kind, typestore=store)
        for at, file in enumerate(files):
            data = numpy.frombuffer(file.read_bytes(), dtype=numpy.uint8)
            message = types[kind](header=header(at), format="jpeg", data=data)
            writer.write(topic, 1_000_000_000 + at * 40_000_000, store.serialize_cdr(message, kind))
            pixels = numpy.full(64 * 48, at % 256, dtype=numpy.uint8)
            message = types[grey_kind](
                header=header(at), height=48, width=64, encoding="mono8", is_bigendian=0, step=64, data=pixels
            )
            writer.write(grey_topic, 1_000_000_000 + at * 40_000_000, store.serialize_cdr(message, grey_kind))


def watched(folder, bag, files, report):
    watch = ["watch", f"{bag}#/finger/image/compressed", "--sensor", "scene/sensor.toml", "--json", "ros.jsonl"]
    slipbound(folder, *watch)
    watched = lines(folder / "ros.jsonl")
    assert watched[0]["clock"] == "container", watched[0]["clock"]
    assert watched[1]["time_ns"] == 100_000_000_000, watched[1]["time_ns"]
    keys = ["seq", "state", "markers", "contact"]
    same = [all(a[k] == b[k] for k in keys) for a, b in zip(watched[1:], report[1:], strict=True)]
    # Times are 40 ms apart here and the scene's own there: what looks back in time may differ, what looks at a frame not.
    assert sum(same) >= 0.9 * len(same), f"{sum(same)} of {len(same)} frames alike"
    slipbound(folder, "record", f"{bag}#/grey", "-o", "grey.mcap")
    with open(folder / "grey.mcap", "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        grey = [message for *_, message in reader.iter_decoded_messages(topics=["/finger/camera"])]
    assert len(grey) == len(files) and all(m.encoding == "mono8" and m.data[5] == i % 256 for i, m in enumerate(grey))
    print(f"{bag.name}, written by rosbags: {len(watched) - 1} compressed and {len(grey)} grey pictures read, {sum(same)} reports alike")


def killed(folder):
    command = [PROGRAM, "emulate", "hand", "--task", "lift", "-o", "hand"]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as hand:
        try:
            streams = [hand.stdout.readline().partition(": ")[2].strip() for _ in ("left", "right")]
            path = folder / "killed.mcap"
            record = subprocess.Popen([PROGRAM, "record", *streams, "-o", path], stderr=subprocess.PIPE)
            began, bytes_count = time.monotonic(), 0
            # Not while a chunk is being written, which takes some milliseconds every half second.
            while time.monotonic() - began < 4 or path.stat().st_size == bytes_count:
                assert time.monotonic() - began < 60, f"{path.stat().st_size} bytes"
                bytes_count = path.stat().st_size if path.exists() else 0
                time.sleep(0.02)
            time.sleep(0.1)
            record.kill()
            record.communicate()
        finally:
            hand.send_signal(signal.SIGINT)
    with open(path, "rb") as file:
        found = [(channel.topic, message.log_time) for _, channel, message in make_reader(file).iter_messages()]
    assert [at for _, at in found] == sorted(at for _, at in found), "by time"
    left, right = (sum(topic == f"/{finger}/camera" for topic, _ in found) for finger in ("left", "right"))
    # 30 Hz for some seconds, on a computer that may have other work.
    assert min(left, right) > 30, f"{left} and {right} pictures"
    print(f"killed with -9: {left} and {right} pictures read by mcap, by time")


with tempfile.TemporaryDirectory() as scratch:
    ros(Path(scratch), *ours(Path(scratch)))
    killed(Path(scratch))
