"""What a codec knows of a message class."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv import protobuf_classes
from dodo_dsl.opendlv.odvd import OdvdError, parse


def layout(text: str, name: str) -> protobuf_classes.Layout:
    return protobuf_classes.build(parse(text))[name]


def test_a_message_of_fixed_size_has_all_fields_written() -> None:
    found = layout("message a.M [id = 1] { float x; double y; bool z; }", "a.M")
    assert found.fixed_size == len(found.filled) == 5 + 9 + 2
    assert (found.texts, found.narrow, dict(found.inner), found.reorder) == ((), (), {}, False)


def test_what_varies_or_needs_care_is_listed() -> None:
    text = "message a.M [id = 1] { uint8 n [id = 3]; string s [id = 1]; a.I i [id = 2]; }"
    found = layout(f"{text} message a.I [id = 2] {{ char c; }}", "a.M")
    assert found.fixed_size is None
    assert (found.texts, found.narrow, found.reorder) == (("s",), (("n", "uint8"),), True)
    assert found.inner["i"].definition.name == "a.I"
    assert list(found.shape) == [3, 1, 2] and list(found.shape[2]) == [1]


@given(st.integers(0, 255), st.booleans())
def test_defaults_are_those_of_the_specification(number: int, flag: bool) -> None:
    text = f"message M [id = 1] {{ uint8 n [default = {number}]; bool b [default = {str(flag).lower()}]; }}"
    message = layout(text, "M").type()
    assert (message.n, message.b) == (number, flag)  # type: ignore[attr-defined]


@pytest.mark.parametrize("names", [("speed", "speed_"), ("foo_bar", "fooBar"), ("x", "X")])
def test_names_that_are_alike_in_json_are_two(names: tuple[str, str]) -> None:
    fields = "".join(f"float {name};" for name in names)
    message = layout(f"message M [id = 1] {{ {fields} }}", "M").type(**dict.fromkeys(names, 1.0))
    assert [field.name for field, _ in message.ListFields()] == list(names)


@pytest.mark.parametrize("name", ["DESCRIPTOR", "ListFields"])
def test_names_that_are_protobufs_own(name: str) -> None:
    with pytest.raises(OdvdError, match=f":1:28: the name '{name}' is protobuf's own, expected another"):
        protobuf_classes.build(parse(f"message M [id = 1] {{ float {name}; }}"))
