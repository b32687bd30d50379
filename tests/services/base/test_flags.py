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
        (["--freq=fast"], "argument --freq: 'fast', expected number in Hz, at least 1, at most 1000"),
        (["--freq=nan"], "argument --freq: 'nan', expected number"),
        (["--freq=1e999"], "argument --freq: '1e999', expected number"),
        (["--freq=1_0"], "argument --freq: '1_0', expected number"),
        (["--freq="], "argument --freq: '', expected number"),
        (["--name="], "argument --name: '', expected memory"),
        (["--freq=0"], "argument --freq: '0', expected number in Hz, at least 1"),
        (["--id=1.5"], "argument --id: '1.5', expected integer, at least 0, at most 4294967295"),
        (["--id=-1"], "argument --id: '-1', expected integer, at least 0"),
        (["--verbose=maybe"], "argument --verbose: 'maybe', expected true or false"),
        (["--role=other"], "argument --role: 'other', expected string, one of echo, judge, source, broken, library"),
    ],
)
def test_what_is_refused(words: list[str], text: str) -> None:
    with pytest.raises(FlagsError) as raised:
        parse(MANIFEST, [*(need for need in NEEDED if "role=" not in words[0] or "role" not in need), *words])
    assert str(raised.value).startswith(text)


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
