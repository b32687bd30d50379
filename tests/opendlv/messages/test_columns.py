from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv import message_columns
from dodo_dsl.opendlv.frame_table import PADDING
from dodo_dsl.opendlv.message_set import MessageError, MessageSet

ODVD = """
message test.Inner [id = 8001] { int8 small [id = 1]; string text [id = 2]; }
message test.Every [id = 8000] {
  bool flag [id = 1]; char letter [id = 2]; uint8 a [id = 3]; int8 b [id = 4]; uint16 c [id = 5]; int16 d [id = 6];
  uint32 e [id = 7]; int32 f [id = 8]; uint64 g [id = 9]; int64 h [id = 10]; float i [id = 11]; double j [id = 12];
  string k [id = 13]; bytes l [id = 14]; test.Inner m [id = 15]; uint8 n [default = 7, id = 200];
}
"""


def integers(bits: int, signed: bool = False) -> st.SearchStrategy[int]:
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    return st.integers(low, high) | st.sampled_from([0, low, high])


VALUES = st.fixed_dictionaries(
    {
        "flag": st.booleans(),
        **{name: integers(bits) for name, bits in (("letter", 8), ("a", 8), ("c", 16), ("e", 32), ("g", 64), ("n", 8))},
        **{name: integers(bits, True) for name, bits in (("b", 8), ("d", 16), ("f", 32), ("h", 64))},
        "i": st.floats(width=32, allow_nan=False),
        "j": st.floats(allow_nan=False),
        "k": st.text(max_size=5),
        "l": st.binary(max_size=200),
        "m": st.fixed_dictionaries({"small": integers(8, True), "text": st.text(max_size=3)}),
    }
)


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> MessageSet:
    path = tmp_path_factory.mktemp("odvd") / "every.odvd"
    path.write_text(ODVD)
    return MessageSet.load(path)


def decoded(messages: MessageSet, payloads: list[bytes]) -> tuple[list[dict[str, Any]], list[bool]]:
    ends = np.cumsum([len(payload) for payload in payloads], dtype=np.int64)
    starts = ends - np.array([len(payload) for payload in payloads], np.int64)
    layout = messages.layout("test.Every")
    decoded, good = message_columns.decode(layout, b"".join(payloads) + PADDING, starts, ends)
    assert [(column.name, column.type) for column in decoded] == list(message_columns.column_names(layout))
    rows = [{column.name: column.values[row] for column in decoded} for row in range(len(payloads))]
    return rows, good.tolist()


def flat(values: dict[str, Any]) -> dict[str, Any]:
    parts = {f"m.{key}": value for key, value in values["m"].items()}
    found = {key: value for key, value in {**values, **parts}.items() if key != "m"}
    return {key: value.encode() if isinstance(value, str) else value for key, value in found.items()}


@given(st.lists(VALUES, min_size=1, max_size=20))
@pytest.mark.thorough
def test_what_was_encoded_is_decoded(messages: MessageSet, values: list[dict[str, Any]]) -> None:
    payloads = [messages.encode(messages.type(8000)(**v)) for v in values]
    assert decoded(messages, payloads) == ([flat(v) for v in values], [True] * len(values))


@given(st.lists(st.binary(max_size=60), min_size=1, max_size=8), VALUES, st.integers(0, 60))
@pytest.mark.thorough
def test_any_bytes_are_decoded_as_the_codec_does(
    messages: MessageSet, payloads: list[bytes], values: dict[str, Any], cut: int
) -> None:
    usual = messages.encode(messages.type(8000)(**values))
    payloads = [*payloads, usual[:cut], usual[cut:], usual]
    rows, good = decoded(messages, payloads)
    for payload, row, ok in zip(payloads, rows, good, strict=True):
        try:
            message = messages.decode(8000, payload)
        except MessageError:
            assert not ok
            continue
        assert ok
        names = ("flag", "letter", "a", "b", "c", "d", "e", "f", "g", "h", "l", "n")
        assert [row[name] for name in names] == [getattr(message, name) for name in names]
        np.testing.assert_array_equal(row["j"], message.j)
    assert good[-1]


def test_a_payload_that_ends_before_the_size_of_its_last_field_is_damaged() -> None:
    standard = MessageSet.standard()
    layout, data = standard.layout(2905), bytes.fromhex("082710a6011a")  # dodo.RecordedStep, its last field is bytes
    with pytest.raises(MessageError):
        standard.decode(2905, data)
    _, good = message_columns.decode(layout, data + PADDING, np.array([0]), np.array([len(data)]))
    assert not good[0]


def test_absent_fields_have_their_defaults(messages: MessageSet) -> None:
    (row,), good = decoded(messages, [b"\x18\x05"])
    assert good == [True]
    assert (row["a"], row["n"], row["i"], row["k"], row["m.text"]) == (5, 7, 0.0, b"", b"")


def test_texts_that_are_no_utf8_are_still_bytes(messages: MessageSet) -> None:
    usual = messages.encode(messages.type(8000)(k="?"))
    (row,), good = decoded(messages, [usual.replace(b"?", b"\xff")])
    assert good == [True] and row["k"] == b"\xff"


def test_usual_payloads_tell_a_message(messages: MessageSet, tmp_path: Path) -> None:
    usual = messages.encode(messages.type(8000)())
    data = usual + b"\x18\x05" + PADDING
    starts, ends = np.array([0, len(usual)]), np.array([len(usual), len(usual) + 2])
    assert message_columns.usual_rows(messages.layout(8000), data, starts, ends).tolist() == [True, False]
