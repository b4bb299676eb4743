"""A session log as programs of others read it: the packages mcap, mcap-protobuf-support and mcap-ros2-support from PyPI, and
rerun-sdk where it is installed. Prints what it found; ends with an error where something is not as docs/session-log.md says."""

import importlib.util
import json
import math
import sys
import xml.etree.ElementTree as xml
from collections import defaultdict

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2

WORDS = {"NaN", "Infinity", "-Infinity"}


def flat(value, schema, name, found):
    """As a plot flattens: by the schema's names, numbers and truth values only."""
    kind = schema["type"]
    if kind == "object":
        assert set(value) <= set(schema["properties"]), (name, value)
        for key, inner in value.items():
            flat(inner, schema["properties"][key], f"{name}/{key}", found)
    elif kind in ("number", "integer") and isinstance(value, str):
        assert value in WORDS, (name, value)
        found[name].append(float(value))
    elif kind in ("number", "integer"):
        assert isinstance(value, (int, float)) and not isinstance(value, bool), (name, value)
        found[name].append(float(value))
    else:
        assert isinstance(value, {"string": str, "boolean": bool}[kind]), (name, value)


def raw(path):
    """Every record, chunk by chunk, with its checksums; no clock of 0, none that goes back."""
    with open(path, "rb") as file:
        assert sum(1 for _ in StreamReader(file, validate_crcs=True).records) > 0
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary.chunk_indexes and summary.statistics, "it has an index"
        in_file = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
    assert in_file and min(in_file) > 0
    assert in_file == sorted(in_file), "log time goes back"
    assert len(in_file) == summary.statistics.message_count
    return summary


def decoded(path):
    topics, numbers = defaultdict(list), defaultdict(list)
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[Protobuf(), Ros2()])
        for schema, channel, message in reader.iter_messages():
            if channel.message_encoding == "json":
                value = json.loads(message.data)
                flat(value, json.loads(schema.data), channel.topic, numbers)
                topics[channel.topic].append(value)
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[Protobuf(), Ros2()])
        wanted = ["/tf", "/tf_static", "/scene", "/log", "/robot_description"]
        for schema, channel, message, value in reader.iter_decoded_messages(topics=wanted):
            topics[channel.topic].append((schema.name, message.log_time, value))
    return topics, numbers


def drawn(topics):
    """The frames of the transforms are the links of the description, and a tree with one root."""
    description = topics["/robot_description"][0][2].data
    robot = xml.fromstring(description)
    links = {link.get("name") for link in robot.findall("link")}
    parents = {}
    times = []
    for topic in ("/tf_static", "/tf"):
        for name, time, message in topics[topic]:
            assert name == "foxglove.FrameTransforms"
            times += [time] if topic == "/tf" else []
            for transform in message.transforms:
                turn = transform.rotation
                norm = math.sqrt(turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2)
                assert abs(norm - 1) < 1e-5, transform
                assert max(abs(transform.translation.x), abs(transform.translation.z)) < 0.5, "metres"
                stamp = transform.timestamp.seconds * 10**9 + transform.timestamp.nanos
                assert 0 <= time - stamp < 10**9, (time, stamp)
                parents[transform.child_frame_id] = transform.parent_frame_id
    assert set(parents) <= links and set(parents.values()) <= links
    for frame in parents:
        steps = 0
        while frame != "world":
            frame, steps = parents[frame], steps + 1
            assert steps < 10
    assert all(b - a >= 49_000_000 for a, b in zip(times, times[1:])), "20 a second at most"
    for name, _, scene in topics["/scene"]:
        assert name == "foxglove.SceneUpdate"
        assert {entity.frame_id for entity in scene.entities} <= links
        assert all(entity.frame_locked and (entity.cubes or entity.cylinders) for entity in scene.entities)
    for name, _, event in topics["/log"]:
        assert name == "foxglove.Log" and event.level in (2, 4) and event.message
    return len(parents), len(links)


def published(summary):
    """The descriptors in the file are those that Foxglove publishes, but for options that name other languages' packages."""
    if importlib.util.find_spec("foxglove_schemas_protobuf") is None:
        return "foxglove-schemas-protobuf is not installed"
    from google.protobuf import descriptor_pool
    from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet

    for name in ("FrameTransforms", "SceneUpdate", "Log"):
        importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2")
    compared = 0
    for schema in summary.schemas.values():
        if schema.encoding != "protobuf":
            continue
        for ours in FileDescriptorSet.FromString(schema.data).file:
            theirs = FileDescriptorProto()
            descriptor_pool.Default().FindFileByName(ours.name).CopyToProto(theirs)
            for file in (ours, theirs):
                file.ClearField("options")
                file.dependency.sort()
                for message in file.message_type:
                    for field in message.field:
                        field.ClearField("json_name")
            assert ours == theirs, f"{ours}\n{theirs}"
            compared += 1
    return f"{compared} descriptors are those that Foxglove publishes"


def in_rerun(path):
    if importlib.util.find_spec("rerun") is None:
        return "rerun-sdk is not installed"
    import subprocess
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        out = f"{folder}/log.rrd"
        run = [sys.executable, "-m", "rerun", "mcap", "convert", path, "-o", out]
        said = subprocess.run(run, capture_output=True, text=True, timeout=120)
        assert said.returncode == 0, said.stderr
        print_it = [sys.executable, "-m", "rerun", "rrd", "print", out]
        shown = subprocess.run(print_it, capture_output=True, text=True, timeout=120).stdout
        check = [sys.executable, "-m", "rerun", "mcap", "check", path]
        checked = subprocess.run(check, capture_output=True, text=True, timeout=120).stdout
    rows = [line for line in checked.splitlines() if "/" in line and "Chunks" not in line]
    bad = [line for line in rows[1:] if not line.startswith("ok")]
    assert rows and not bad, checked
    # Transforms by frame names, and shapes of the description on those frames.
    of_tf = [line for line in shown.splitlines() if " - /tf " in f"{line} " and "Transform3D:child_frame" in line]
    shapes = [line for line in shown.splitlines() if "/visual_geometries/" in line and "CoordinateFrame:frame" in line]
    assert of_tf and len(shapes) >= 29, shown[:3000]
    return f"rerun-sdk imports it: {len(of_tf)} chunks of transforms, {len(shapes)} shapes on their frames"


def main(path):
    summary = raw(path)
    topics, numbers = decoded(path)
    moving, links = drawn(topics)
    print(f"{summary.statistics.message_count} messages, {len(summary.chunk_indexes)} chunks, {len(numbers)} numbers to plot")
    print(f"{moving} frames of {links} links")
    for topic in sorted(topics):
        print(f"{topic:22} {len(topics[topic])}")
    print(published(summary))
    print(in_rerun(path))


main(sys.argv[1])
