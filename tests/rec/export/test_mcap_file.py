"""MCAP files as the packages' own readers have them, against tables of ``--csv`` and the recording's packets."""

import base64
import csv
import math
import random
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from scipy.spatial.transform import Rotation

import dodo_dsl.rec
from dodo_dsl import advice
from dodo_dsl.opendlv import message_versions
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec import mcap
from dodo_dsl.rec.mcap import topic
from tests.opendlv.test_against_libcluon import some_value
from tests.rec.conftest import BEGIN, MESSAGES, dodo_rec, message, video

OWN = ("/camera/", "/picture/", "/tf")


def read(path: Path) -> dict[str, list[tuple[Any, Any]]]:
    """The messages of each topic in the order of the file, as records and decoded."""
    found = defaultdict(list)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, record, decoded in reader.iter_decoded_messages(log_time_order=False):
            found[channel.topic].append((record, decoded))
        summary = reader.get_summary()
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == sum(map(len, found.values()))
    return found


def export(path: Path, target: Path, *words: str) -> dict[str, list[tuple[Any, Any]]]:
    code, _, stderr = dodo_rec("export", path, "--mcap", "-o", target, *words)
    assert code == 0, stderr
    return read(target)


def tables(path: Path, folder: Path, *words: str) -> dict[str, list[dict[str, str]]]:
    """The rows of each table by topic, in the order of their sample times."""
    code, _, stderr = dodo_rec("export", path, "--csv", "-o", folder, *words)
    assert code == 0, stderr
    found = {}
    for file in folder.glob("*.csv"):
        name, _, stamp = file.stem.rpartition("-")
        with file.open(encoding="latin-1") as stream:
            found[topic(name, int(stamp))] = list(csv.DictReader(stream, delimiter=";"))
    return found


def cell(field: Any, value: Any) -> str:
    """A value as it stands in a table; both agree on the numbers' last digit."""
    kinds = {field.TYPE_FLOAT: "%.7g", field.TYPE_DOUBLE: "%.11g"}
    if field.type in kinds:
        return "nan" if math.isnan(value) else kinds[field.type] % value
    if field.type in (field.TYPE_STRING, field.TYPE_BYTES):
        return base64.b64encode(value.encode() if isinstance(value, str) else value).decode()
    return str(int(value))


def cells(decoded: Any, prefix: str = "") -> Iterator[tuple[str, str]]:
    for field in decoded.DESCRIPTOR.fields:
        value = getattr(decoded, field.name)
        if field.type == field.TYPE_MESSAGE:
            yield from cells(value, f"{field.name}.")
        else:
            yield prefix + field.name, cell(field, value)


def row(record: Any, decoded: Any) -> tuple[int, Counter[tuple[str, str]]]:
    return record.publish_time // 1000, Counter(cells(decoded))


def row_of_table(line: dict[str, str]) -> tuple[int, Counter[tuple[str, str]]]:
    """Of a message's fields; letters are numbers in protobuf."""
    fields = {name: text for name, text in line.items() if name and text is not None}
    times = {name: int(fields.pop(name)) for name in list(fields) if name.partition(".")[0] in TIMES}
    return time_of(times, "sent"), Counter((n, t.replace("-nan", "nan")) for n, t in fields.items())


TIMES = ("sent", "received", "sampleTimeStamp")


def time_of(times: dict[str, int], name: str) -> int:
    return times[f"{name}.seconds"] * 1_000_000 + times[f"{name}.microseconds"]


def assert_same_values(path: Path, folder: Path, *words: str) -> dict[str, list[tuple[Any, Any]]]:
    """Counts and values of every topic are those of the tables; returns the topics beside them."""
    found = export(path, folder / "out.mcap", *words)
    expected = tables(path, folder / "tables", *words)
    assert set(expected) == {name for name in found if not name.startswith(OWN)}
    for name, lines in expected.items():
        ours = [row(*each) for each in found[name]]
        theirs = [row_of_table(line) for line in lines]
        assert len(ours) == len(theirs)
        key = lambda each: (each[0], sorted(each[1]))  # noqa: E731
        assert sorted(ours, key=key) == sorted(theirs, key=key), name
    return {name: messages for name, messages in found.items() if name.startswith(OWN)}


def packets(path: Path, stamp: int) -> list[bytes]:
    with Recording(path) as recording:
        rows = recording.rows(messages=[1055], sender_stamps=[stamp])
        return [MessageSet.standard().decode(1055, each.payload).data for each in recording.envelopes(rows)]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["track-1-2025-05-08.rec", "sim-2023-04-27.rec", "cones-2020-05-15.rec"])
def test_recordings_of_others(name: str, shared_data: Callable[[str], Path], tmp_path: Path) -> None:
    path = shared_data(name)
    beside = assert_same_values(path, tmp_path)
    if name.startswith("track"):
        assert [decoded.data for _, decoded in beside["/camera/0"]] == packets(path, 0)
    assert ("/tf" in beside) == name.startswith("sim")


def every_message(seed: int, count: int) -> Iterator[Envelope]:
    rng = random.Random(seed)
    for _ in range(count):
        for name in MESSAGES.names():
            definition = MESSAGES.layout(name).definition
            values = {field.name: some_value(field, rng) for field in definition.fields}
            payload = MESSAGES.encode(MESSAGES.type(name)(**values))
            sent = BEGIN + rng.randrange(10**9)
            yield Envelope(definition.id, payload, sent, sent + 3, rng.choice([0, sent - 5]), rng.randrange(3))


@pytest.mark.slow
def test_every_message_with_every_kind_of_number(tmp_path: Path, record: Callable[..., Path]) -> None:
    assert_same_values(record(every_message(18, 4)), tmp_path, "--messages=1.0")


def test_frames_are_the_packets_of_the_recording(tmp_path: Path, record: Callable[..., Path]) -> None:
    path = record([*video(8), *video(3, 5, 4)])
    beside = assert_same_values(path, tmp_path)
    for stamp in (0, 4):
        found = [decoded for _, decoded in beside[f"/camera/{stamp}"]]
        assert [each.data for each in found] == packets(path, stamp)
        assert {(each.DESCRIPTOR.full_name, each.format, each.frame_id) for each in found} == {
            ("foxglove.CompressedVideo", "h264", f"camera-{stamp}")
        }
        assert [each.timestamp.ToNanoseconds() for each in found] == [
            (BEGIN + number * 100_000) * 1000 for number in range(len(found))
        ]


def test_times_of_messages(tmp_path: Path, record: Callable[..., Path]) -> None:
    """In the order of their sample times; without one it is when the message was received, or else sent."""
    name = "opendlv.proxy.DistanceReading"
    first = message(name, BEGIN, distance=1)
    envelopes = [
        first._replace(sample_time=BEGIN + 40),
        first._replace(sample_time=BEGIN + 10, sent=BEGIN + 1000),
        first._replace(sample_time=0, received=BEGIN + 30),
        first._replace(sample_time=0, received=0, sent=BEGIN + 20),
        first._replace(sample_time=-7, sent=-3),
    ]
    found = export(record(envelopes), tmp_path / "out.mcap")["/opendlv/proxy/DistanceReading/0"]
    assert [(each.log_time, each.publish_time) for each, _ in found] == [
        (0, 0),
        ((BEGIN + 10) * 1000, (BEGIN + 1000) * 1000),
        ((BEGIN + 20) * 1000, (BEGIN + 20) * 1000),
        ((BEGIN + 30) * 1000, (BEGIN + 5) * 1000),
        ((BEGIN + 40) * 1000, (BEGIN + 5) * 1000),
    ]


def test_poses(tmp_path: Path, record: Callable[..., Path]) -> None:
    half = math.sqrt(0.5)
    frame = {"x": 1.5, "y": -2.0, "z": 0.25, "qz": half, "qw": half}
    envelopes = [
        message("opendlv.sim.Frame", BEGIN, 2, **frame),
        message("opendlv.sim.Frame", BEGIN + 1, 2),
        message("opendlv.sim.Frame", BEGIN + 2, 2, x=math.nan),
    ]
    beside = assert_same_values(record(envelopes), tmp_path, "--messages=1.0")
    first, second = [decoded for _, decoded in beside["/tf"]]
    assert (first.parent_frame_id, first.child_frame_id) == ("world", "frame-2")
    assert [getattr(first.translation, axis) for axis in "xyz"] == [1.5, -2.0, 0.25]
    assert [getattr(first.rotation, axis) for axis in "xyzw"] == pytest.approx([0, 0, half, half])
    assert [getattr(second.rotation, axis) for axis in "xyzw"] == [0, 0, 0, 1]


ANGLE = st.floats(-3.125, 3.125, width=32)


@settings(max_examples=50)
@given(ANGLE, ANGLE, ANGLE)
def test_angles_of_set_0_9_turn_as_three_rotations(roll: float, pitch: float, yaw: float) -> None:
    """Against scipy's rotations."""
    layout = message_versions.load(message_versions.OLD).layout("opendlv.sim.Frame")
    convert = mcap.converter(layout)
    assert convert is not None
    found = convert(layout.type(roll=roll, pitch=pitch, yaw=yaw), 0, BEGIN)
    assert found is not None
    ours: Any = found[1]
    turned = Rotation.from_quat([getattr(ours.rotation, axis) for axis in "xyzw"])
    expected = Rotation.from_euler("xyz", [roll, pitch, yaw])
    assert (turned * expected.inv()).magnitude() == pytest.approx(0, abs=1e-6)


def test_other_formats_of_pictures(tmp_path: Path, record: Callable[..., Path]) -> None:
    name = "opendlv.proxy.ImageReading"
    formats = [("H264", "/camera/0"), ("VP90", "/camera/1"), ("mjpg", "/picture/2"), ("VP80", ""), ("\N{SNOWMAN}", "")]
    path = record([message(name, BEGIN, n, format=f, data=b"abc") for n, (f, _) in enumerate(formats)])
    beside = assert_same_values(path, tmp_path)
    assert {name for name, _ in beside.items()} == {where for _, where in formats if where}
    assert {decoded.data for each in beside.values() for _, decoded in each} == {b"abc"}
    assert beside["/picture/2"][0][1].format == "jpeg"


def test_messages_of_ones_own(tmp_path: Path, record: Callable[..., Path]) -> None:
    """Also one in another, and a Frame of other fields, which is no pose."""
    odvd = tmp_path / "own.odvd"
    odvd.write_text(
        "message team.Point [id = 8001] { float x [id = 1]; int16 y [id = 2]; }\n"
        "message team.Cone [id = 8000] { team.Point at [id = 1]; uint64 big [id = 3]; }\n"
        "message opendlv.sim.Frame [id = 1003] { string x [id = 1]; }\n"
    )
    point = b"\x0d\x00\x00\x80\x3f\x10\x05"
    payload = b"\x0a" + bytes([len(point)]) + point + b"\x18" + b"\xff" * 9 + b"\x01"
    envelopes = [Envelope(8000, payload, 1, 2, 3, 7), Envelope(1003, b"\x0a\x01a", 1, 2, 3, 0)]
    assert assert_same_values(record(envelopes), tmp_path, f"--messages={odvd}", "--messages=1.0") == {}
    ((_, cone),) = read(tmp_path / "out.mcap")["/team/Cone/7"]
    assert (cone.at.x, cone.at.y, cone.big) == (1.0, -3, 2**64 - 1)


def test_fields_that_are_absent_or_repeated_have_libcluon_s_values(tmp_path: Path, record: Callable[..., Path]) -> None:
    """The first of equal fields counts, which for protobuf is the last."""
    distance = b"\x0d\x00\x00\x80\x3f", b"\x0d\x00\x00\x00\x40"
    envelopes = [Envelope(1039, b"".join(distance), 1, 2, 3, 0), Envelope(1103, b"", 1, 2, 3, 0)]
    assert assert_same_values(record(envelopes), tmp_path, "--messages=1.0") == {}
    ((_, reading),) = read(tmp_path / "out.mcap")["/opendlv/proxy/DistanceReading/0"]
    assert reading.distance == 1.0


def test_what_is_left_out_is_told(tmp_path: Path, record: Callable[..., Path]) -> None:
    good, target = message("opendlv.proxy.DistanceReading", BEGIN, distance=2.5), tmp_path / "out.mcap"
    path = record([good, good._replace(payload=b"\x0d\x00"), good._replace(data_type=1144)], before=b"??")
    code, stdout, stderr = dodo_rec("export", path, "--mcap", "-o", target)
    assert (code, stdout) == (0, f"{target}: 1 messages, and 0 of them for Foxglove, too\n")
    assert stderr == (
        f"dodo rec: {path}: skipped 2 bytes at byte 0: no frame begins here\n"
        "dodo rec: skipped unknown messages: 1144\n"
        "dodo rec: skipped 1 payload of opendlv.proxy.DistanceReading that cannot be decoded\n"
    )
    assert list(read(target)) == ["/opendlv/proxy/DistanceReading/0"]
    alone = dodo_rec("export", record([good._replace(data_type=1144)]), "--mcap", "-o", tmp_path / "none.mcap")
    assert alone.code == 2 and not (tmp_path / "none.mcap").exists()


def test_only_what_is_selected(tmp_path: Path, record: Callable[..., Path]) -> None:
    path = record([message("opendlv.proxy.DistanceReading", BEGIN + n * 1_000_000, n % 2) for n in range(6)])
    found = export(path, tmp_path / "out.mcap", "--message=1039/1", "--start=2")
    assert [each.log_time for each, _ in found["/opendlv/proxy/DistanceReading/1"]] == [
        (BEGIN + second * 1_000_000) * 1000 for second in (3, 5)
    ]
    assert len(found) == 1


def test_too_many_topics(tmp_path: Path, record: Callable[..., Path]) -> None:
    path = record([message("opendlv.proxy.DistanceReading", BEGIN, stamp) for stamp in range(1001)])
    answer = dodo_rec("export", path, "--mcap", "-o", tmp_path / "out.mcap")
    text = f"{path} would become 1001 topics, expected at most 1000; choose messages with --message"
    assert answer == (2, "", f"dodo rec: {text}\n")


def test_the_module_that_is_missing_is_named(
    tmp_path: Path, record: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "dodo_dsl.rec.mcap")
    monkeypatch.delattr(dodo_dsl.rec, "mcap")
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    answer = dodo_rec("export", record(video(1)), "--mcap", "-o", tmp_path / "out.mcap")
    assert (answer.code, answer.stdout) == (2, "")
    assert answer.stderr == f"dodo rec: --mcap needs mcap: {advice.install('mcap')}\n"


def test_the_same_recording_gives_the_same_file(tmp_path: Path, record: Callable[..., Path]) -> None:
    path = record(video(4))
    for name in ("a.mcap", "b.mcap"):
        export(path, tmp_path / name)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


@pytest.mark.slow
def test_a_full_disk_leaves_nothing(record: Callable[..., Path], small_disk: Path) -> None:
    envelopes = [message("opendlv.proxy.ImageReading", n, data=bytes(range(256)) * n, format="h264") for n in range(99)]
    answer = dodo_rec("export", record([*every_message(3, 3), *envelopes]), "--mcap", "-o", small_disk / "out.mcap")
    assert (answer.code, answer.stderr) == (3, f"dodo rec: {small_disk}/out.mcap: No space left on device\n")
    assert list(small_disk.iterdir()) == []
