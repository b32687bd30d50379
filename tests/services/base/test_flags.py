from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.base.flags import FlagsError, load_manifest, parse

MANIFEST = load_manifest(Path(__file__).with_name("tiny"))
NEEDED = ("--cid=128", "--role=echo")


def test_values_have_their_types_and_defaults() -> None:
    flags = parse(MANIFEST, [*NEEDED, "--walls=left,right", "--verbose", "--id=7"])
    assert dict(flags) == {
        "role": "echo",
        "freq": 50.0,
        "name": "",
        "walls": ["left", "right"],
        "cid": 128,
        "id": 7,
        "ends-input": False,
        "verbose": True,
    }
    assert isinstance(flags["freq"], float)


@pytest.mark.parametrize(("text", "value"), [("2", 2.0), ("1e1", 10.0), ("+12.50", 12.5), (".5e1", 5.0)])
def test_numbers(text: str, value: float) -> None:
    assert parse(MANIFEST, [*NEEDED, f"--freq={text}"])["freq"] == value


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["freq=1"], "unrecognized arguments: freq=1"),
        (["--freq"], "argument --freq: expected one argument"),
        (["--frequency=1"], "unrecognized arguments: --frequency=1"),
        (["--freq=fast"], "--freq=fast is not a finite number in Hz"),
        (["--freq=nan"], "--freq=nan is not a finite number in Hz"),
        (["--freq=1e999"], "--freq=1e999 is not a finite number in Hz"),
        (["--freq=1_0"], "--freq=1_0 is not a finite number in Hz"),
        (["--freq="], "--freq= is not a finite number in Hz"),
        (["--name="], "--name= is not a name"),
        (["--freq=0"], "--freq=0 is out of range, expected 1 to 1000 Hz"),
        (["--id=1.5"], "--id=1.5 is not a whole number"),
        (["--id=-1"], "--id=-1 is out of range, expected 0 to 4294967295"),
        (["--verbose=maybe"], "--verbose=maybe is not true or false"),
        (
            ["--role=other"],
            "--role=other is not one of echo, judge, source, broken, library, field, unjudgeable, unbuildable",
        ),
    ],
)
def test_what_is_refused(words: list[str], text: str) -> None:
    with pytest.raises(FlagsError) as raised:
        parse(MANIFEST, [*(need for need in NEEDED if "role=" not in words[0] or "role" not in need), *words])
    assert str(raised.value) == text


def test_what_is_required() -> None:
    with pytest.raises(FlagsError, match="the following arguments are required: --cid"):
        parse(MANIFEST, ["--role=echo"])


NAMES = st.sampled_from(["freq", "id", "name", "walls", "verbose"])
WORDS = st.builds("--{}{}".format, NAMES, st.just("") | st.text().map("={}".format))


@given(st.lists(st.text() | WORDS))
@pytest.mark.thorough
def test_any_words_give_flags_or_one_sentence(words: list[str]) -> None:
    try:
        flags = parse(MANIFEST, [*NEEDED, *words])
    except FlagsError as error:
        assert str(error)
    else:
        assert 1.0 <= flags["freq"] <= 1000.0
