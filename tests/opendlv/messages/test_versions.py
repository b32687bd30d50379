"""The shipped sets: whole, without clashes, each with the other's messages where ids and names are free."""

import struct
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.opendlv import message_versions, odvd
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import OWN_IDS, MessageSet
from dodo_dsl.opendlv.message_versions import NEW, OLD
from dodo_dsl.opendlv.odvd import STANDARD, STANDARD_0_9
from dodo_dsl.opendlv.recording import Recording

SETS = {version: message_versions.load(version) for version in (OLD, NEW)}
WHOLE = {
    # 1.0 of March 2024
    STANDARD: [
        *(19, 1002, 1003, 1004, 1010, 1011, 1014, 1015, 1016, 1017, 1020, 1021, *range(1029, 1044), *range(1045, 1049)),
        *(1050, 1051, 1054, 1055, 1056, 1060, 1061, *range(1079, 1097), *range(1100, 1105), 1110, 1111, 1116, 1117),
        *(1119, *range(1130, 1137), 1171, 1172, 1173, 1180, 1181),
    ],
    # 0.9.1 to 0.9.10, without what 1.0 has in the same way
    STANDARD_0_9: [49, 1001, 1017, 1055, 1118, *range(1128, 1137), *range(1140, 1144), 1180, 1181],
}


def floats(*values: float) -> bytes:
    """Fields 1, 2, 3 and so on of a payload that holds numbers only."""
    return b"".join(bytes([number << 3 | 5]) + struct.pack("<f", value) for number, value in enumerate(values, 1))


@pytest.mark.parametrize("path", WHOLE, ids=lambda path: path.name)
def test_a_file_holds_every_message_of_its_set(path: Path) -> None:
    standard = [d.id for d in odvd.load(path) if d.name.startswith("opendlv.")]
    assert sorted(standard) == sorted(WHOLE[path])


@pytest.mark.parametrize("version", SETS)
def test_names_and_ids_are_unique(version: str) -> None:
    messages = SETS[version]
    assert len(messages.names()) == len(messages.ids())
    assert [messages.id(messages.name(id_)) for id_ in messages.ids()] == list(messages.ids())
    assert {messages.name(id_).startswith("dodo.") for id_ in messages.ids() & set(OWN_IDS)} == {True}
    assert not any(messages.name(id_).startswith("dodo.") for id_ in messages.ids() - set(OWN_IDS))


@pytest.mark.parametrize(
    ("id_", "payload", "fields"),
    [
        (1017, floats(1, 2, 3, 4, 5, 6), {"vx": 1, "vy": 2, "vz": 3, "rollRate": 4, "pitchRate": 5, "yawRate": 6}),
        (1055, b"\x0a\x04h264\x10\x20\x18\x10\x22\x01x", {"fourcc": "h264", "width": 32, "height": 16, "data": b"x"}),
        (1118, floats(1, 0, -2), {"roll": 1, "pitch": 0, "yaw": -2}),
        (1181, b"\x08\x02\x12\x01x", {"length": 2, "data": b"x"}),
    ],
)
def test_what_only_0_9_has_is_decoded(id_: int, payload: bytes, fields: dict[str, object]) -> None:
    found = {field.name: value for field, value in SETS[OLD].decode(id_, payload).ListFields()}
    assert fields.items() <= found.items()


def test_a_copy_of_a_set_replaces_nothing_of_the_other(tmp_path: Path) -> None:
    copy = tmp_path / "team.odvd"
    copy.write_text(STANDARD_0_9.read_text() + "message team.Lane [id = 3144] { float offset; }")
    for version in (OLD, NEW):
        found = message_versions.load(version, copy)
        assert {*found.names()} - {*SETS[version].names()} == {"team.Lane"}
        assert found.id("opendlv.sim.Frame") == SETS[version].id("opendlv.sim.Frame")


def test_every_id_whose_payloads_tell_the_sets_apart_is_looked_at() -> None:
    old, new = SETS[OLD], SETS[NEW]
    apart = old.ids() ^ new.ids() | {id_ for id_ in old.ids() & new.ids() if wire(old, id_) != wire(new, id_)}
    assert apart - {1055} == set(message_versions.TELLING) - {1128, 1129}, (
        "these two have no clash, but only 0.9 has them"
    )


def wire(messages: MessageSet, id_: int) -> list[tuple[int, str]]:
    return [(field.number, field.type) for field in messages.layout(id_).definition.fields]


@pytest.mark.parametrize(
    ("payloads", "version"),
    [
        ({1118: floats(1, 2, 3)}, OLD),
        ({1119: floats(0, 0, 0, 1)}, NEW),
        ({1017: floats(1, 2, 3, 4, 5, 6)}, OLD),
        ({1017: floats(1, 2, 3, 0, 0, 0, 1) + b"\x40\x07"}, NEW),
        ({1181: b"\x08\x02\x12\x01x"}, OLD),
        ({1181: b"\x0a\x02xy\x10\x01\x1a\x01x"}, NEW),
        ({1032: floats(1, 2, 3), 1140: b"\x08\x01"}, NEW),  # 1140 is free in 1.0, and may be a team's own
    ],
)
def test_the_set_is_told_by_its_payloads(payloads: dict[int, bytes], version: str, tmp_path: Path) -> None:
    path = tmp_path / "a.rec"
    path.write_bytes(b"".join(encode_frame(Envelope(id_, payload, 1, 1, 1, 0)) for id_, payload in payloads.items()))
    with Recording(path) as recording:
        assert message_versions.version_of(recording) == version


@pytest.mark.parametrize("name", ["cones-2020-05-15.rec", "sim-2023-04-27.rec", "track-1-2025-05-08.rec"])
def test_recordings_of_others_hold_known_messages(name: str, shared_data: Callable[[str], Path]) -> None:
    with Recording(shared_data(name)) as recording:
        messages = message_versions.load(message_versions.version_of(recording))
        found = Counter(recording.index["data_type"].tolist())
    assert set(found) - messages.ids() <= {1144}, "1144 is the author's own"
