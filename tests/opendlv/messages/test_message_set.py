import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.message_set import MessageError, MessageSet, UnknownMessage
from dodo_dsl.opendlv.odvd import OdvdError
from tests.opendlv import vectors

STANDARD = MessageSet.standard()


@pytest.fixture
def message_set(tmp_path: Path) -> Callable[[str], MessageSet]:
    def load(text: str) -> MessageSet:
        path = tmp_path / "own.odvd"
        path.write_text(text)
        return MessageSet.load(path)

    return load


def test_payloads_of_libcluon(shared_data: Callable[[str], Path]) -> None:
    found = vectors.read(shared_data("od4-vectors.txt"))
    assert len(found) == 12
    for vector in found:
        message = STANDARD.decode(vector.id, vector.payload)
        assert STANDARD.encode(message) == vector.payload, vector.title


@pytest.mark.parametrize(
    ("name", "fields", "payload"),
    [
        ("opendlv.proxy.GroundSteeringRequest", {"groundSteering": -0.25}, "0d000080be"),
        ("opendlv.proxy.GroundSteeringRequest", {}, "0d00000000"),
        ("opendlv.proxy.SwitchStateReading", {"state": -3}, "0805"),
        ("opendlv.system.LogMessage", {"description": "x"}, "0806120178"),
        ("opendlv.logic.perception.DetectionType", {"sampleId": 300}, "08ac0210001800"),
        ("opendlv.proxy.ImageReading", {}, "0a00100018002200" + "2800"),
        ("cluon.data.TimeStamp", {"seconds": -1, "microseconds": -500_000}, "080110bf843d"),
    ],
)
def test_every_field_is_written(name: str, fields: dict[str, Any], payload: str) -> None:
    message = STANDARD.type(name)(**fields)
    assert STANDARD.encode(message).hex() == payload
    assert STANDARD.decode(STANDARD.id(name), bytes.fromhex(payload)).ListFields()


def test_the_first_of_equal_fields_counts_in_any_order_and_encoding() -> None:
    x1, x2 = b"\x1d" + struct.pack("<f", 1.0), b"\x1d" + struct.pack("<f", 2.0)
    sample_id = b"\x88\x00" + b"\x87\x80\x00"  # 7, neither key nor value in the shortest form
    unknown = b"\xfa\x07\x01a"
    message = STANDARD.decode(1134, x1 + unknown + x2 + sample_id + b"\x08\x09")
    assert (message.x, message.sampleId, message.y) == (1.0, 7, 0.0)
    assert STANDARD.decode(1103, b"").level == 6


def test_large_integers_lose_their_upper_bits_as_in_libcluon() -> None:
    assert STANDARD.decode(1103, b"\x08\x81\x02").level == 1  # 257
    assert STANDARD.decode(1040, b"\x08\x85\x80\x04").state == -3  # 65541, zigzag


@pytest.mark.parametrize(
    ("id_", "payload"),
    [(1090, b"\x0d\x00"), (1090, b"\x0b"), (1104, b"\x0a\x02\xff\xfe"), (1104, b"\x0a\xff\xff\xff\xff\x0f")],
)
def test_malformed_payloads(id_: int, payload: bytes) -> None:
    with pytest.raises(MessageError, match=r"^the payload is not a valid opendlv\."):
        STANDARD.decode(id_, payload)


def test_numbers_that_do_not_fit_are_refused() -> None:
    with pytest.raises(MessageError, match=r"LogMessage\.level is uint8 and cannot be 256"):
        STANDARD.encode(STANDARD.type("opendlv.system.LogMessage")(level=256))


@pytest.mark.parametrize(
    ("key", "text"),
    [
        (1, "there is no message '1'"),
        ("GroundSteeringRequest", "did you mean 'opendlv.proxy.GroundSteeringRequest'?"),
        ("opendlv.proxy.GroundStearingRequest", "did you mean 'opendlv.proxy.GroundSteeringRequest'?"),
        ("x", "there is no message 'x'"),
    ],
)
def test_unknown_messages(key: str | int, text: str) -> None:
    with pytest.raises(UnknownMessage) as raised:
        STANDARD.type(key)
    assert str(raised.value).endswith(text)


def test_own_messages_replace_standard_ones(message_set: Callable[[str], MessageSet]) -> None:
    messages = message_set(
        "message opendlv.sim.Frame [id = 1001] { float x; float yaw; }"
        "message opendlv.logic.perception.Object [id = 1130] { uint32 objectId; }"
    )
    assert messages.id("opendlv.sim.Frame") == 1001
    assert messages.name(1130) == "opendlv.logic.perception.Object"
    for gone in ("opendlv.logic.perception.DetectionType", 1003):
        with pytest.raises(UnknownMessage):
            messages.type(gone)


def test_what_is_kept_is_not_replaced(tmp_path: Path) -> None:
    path, frame, type_ = tmp_path / "own.odvd", "opendlv.sim.Frame", "opendlv.logic.perception.DetectionType"
    path.write_text(f"message {frame} [id = 1001] {{ float x; }} message team.Object [id = 1130] {{ float size; }}")
    messages = MessageSet.load(path, kept={frame, type_})
    assert (messages.id(frame), messages.id(type_), messages.id("team.Object")) == (1003, 1130, 1130)
    assert messages.name(1130) == "team.Object" and 1001 not in messages.ids()


def test_nested_messages_and_fields_out_of_order(message_set: Callable[[str], MessageSet]) -> None:
    messages = message_set(
        "package own; message Inner [id = 3000] { uint8 b [id = 2]; uint8 a [id = 1]; }"
        "message Outer [id = 3001] { Inner late [id = 3]; cluon.data.TimeStamp time [id = 1]; int8 n [id = 2]; }"
    )
    outer = messages.type(3001)
    outer_message = outer(n=-1)
    outer_message.late.a = 5
    payload = messages.encode(outer_message)
    assert messages.encode(messages.decode(3001, payload)) == payload
    doubled = messages.decode(3001, bytes.fromhex("1a04080510071a020806"))
    assert (doubled.late.a, doubled.late.b) == (5, 7)
    with pytest.raises(MessageError, match=r"Inner\.a is uint8"):
        messages.encode(outer(late={"a": 300}))


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("message M [id = 2950] {}", ":1:9: ids 2900 to 2999 and names that begin with 'dodo.'"),
        ("message dodo.Step [id = 3000] {}", ":1:9: ids 2900 to 2999 and names that begin with 'dodo.'"),
        ("message M [id = 3000] { Nothing x; }", ":1:33: 'Nothing' is neither a type nor a message"),
        ("message M [id = 3000] { M x; }", "'M' nests messages without end"),
    ],
)
def test_specifications_that_cannot_be_used(message_set: Callable[[str], MessageSet], text: str, error: str) -> None:
    with pytest.raises(OdvdError) as raised:
        message_set(text)
    assert error in str(raised.value)


def test_files_may_repeat_but_not_contradict_each_other(tmp_path: Path) -> None:
    one, same, other = (tmp_path / name for name in ("one.odvd", "same.odvd", "other.odvd"))
    one.write_text("message M [id = 3000] { float x; }")
    same.write_text("\nmessage M [id = 3000] { float x [id = 1]; }")
    other.write_text("message M [id = 3000] { float y; }")
    assert MessageSet.load(one, same).name(3000) == "M"
    with pytest.raises(OdvdError, match=r"other\.odvd:1:9: 'M' is another message at .*one\.odvd:1:9"):
        MessageSet.load(one, other)
