from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv import odvd
from dodo_dsl.opendlv.odvd import OdvdError


def test_names_ids_types_and_defaults() -> None:
    first, second = odvd.parse(
        """
        package a.b; // libcluon writes the package before the name
        message c.First [id = 7,] {
          uint8 level [default = 6, id = 3];
          float x [id = 1]; /* a comment
                               of two lines */
          string text [id = 9, default = "so"];
        }
        message Second [id = 8] { bool on [default = true]; char sign [default = 'x']; c.First inner; }
        """
    )
    assert (first.name, first.id) == ("a.b.c.First", 7)
    assert [(f.name, f.type, f.number, f.default) for f in first.fields] == [
        ("level", "uint8", 3, 6),
        ("x", "float", 1, None),
        ("text", "string", 9, "so"),
    ]
    assert [(f.name, f.number, f.default) for f in second.fields] == [
        ("on", 1, True),
        ("sign", 2, ord("x")),
        ("inner", 3, None),
    ]


def test_fields_without_id_are_counted_apart_from_the_others() -> None:
    (message,) = odvd.parse("message M [id = 1] { float a [id = 5]; float b; float c []; }")
    assert [field.number for field in message.fields] == [5, 1, 2]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("mesage M [id = 1] {}", "f.odvd:1:1: expected a message such as 'message Name [id = 1] {', found 'mesage'"),
        ("\n message M {}", "f.odvd:2:2: expected a message"),
        ("message M [id = 0] {}", "f.odvd:1:9: expected an id, a whole number from 1 to 2147483647, found '0'"),
        ("message M [id = 99999999999999] {}", "f.odvd:1:9: expected an id, a whole number"),
        ("message M [id = 1] {\n  float x [id = 1]\n}", "f.odvd:2:3: expected a field such as 'float x [id = 1];'"),
        ("message M [id = 1] {", "f.odvd:1:21: expected a field such as 'float x [id = 1];', or '}', found the end"),
        ("message M [id = 1] { float x; float x; }", "f.odvd:1:37: the name or id 'x' is already used at line 1"),
        ("message M [id = 1] {\nfloat x;\nfloat y [id = 1]; }", "f.odvd:3:7: the name or id '1' is already used"),
        ("message M [id = 1] {}\nmessage M [id = 2] {}", "f.odvd:2:9: the name or id 'M' is already used at line 1"),
        ("message M [id = 1] {}\nmessage N [id = 1] {}", "f.odvd:2:9: the name or id '1' is already used at line 1"),
        ("message M [id = 1] { uint8 x [default = 256]; }", "256 is not a default for a field of type 'uint8'"),
        ("message M [id = 1] { uint8 x [default = 1.5]; }", "1.5 is not a default for a field of type 'uint8'"),
        ("message M [id = 1] { bool x [default = 1]; }", "1 is not a default for a field of type 'bool'"),
        ("message M [id = 1] { float x [ide = 3]; }", "1:28: expected 'id = 1' or 'default = 0' in brackets"),
        ("message M [id = 1] { float a.b; }", "f.odvd:1:22: expected a field such as"),
        ("message M [id = 1] {} ?", "f.odvd:1:23: expected a message"),
        ("/* no end", "f.odvd:1:1: expected a message"),
    ],
)
def test_errors_name_the_place(text: str, error: str) -> None:
    with pytest.raises(OdvdError) as raised:
        odvd.parse(text, "f.odvd")
    assert error in str(raised.value)


def test_files_that_cannot_be_used(tmp_path: Path) -> None:
    missing, binary, large = tmp_path / "missing.odvd", tmp_path / "binary.odvd", tmp_path / "large.odvd"
    binary.write_bytes(b"\xff\xfe")
    large.write_text(" " * (odvd.MAX_FILE_BYTES + 1))
    for path, text in [(missing, "No such file"), (binary, "UTF-8"), (large, "larger than 1000000 bytes")]:
        with pytest.raises(OdvdError, match=text) as raised:
            odvd.load(path)
        assert str(raised.value).startswith(f"{path}: ")


@pytest.mark.thorough
@given(st.text() | st.text("message M[id=1]{}float x;,\"'0/*\n"))
def test_any_text_gives_messages_or_an_error_with_a_place(text: str) -> None:
    try:
        messages = odvd.parse(text, "f.odvd")
    except OdvdError as error:
        assert str(error).startswith("f.odvd:")
    else:
        assert all(message.id > 0 for message in messages)
