import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.gantry.protocol import LONGEST, Answer, LineReader, Position, Refusal, Word, answer, command
from services.gantry.rig_table import Status
from tests.services.gantry.fake_rig import COMMAND

numbers = st.floats(-10, 10)
positions = st.builds(Position, numbers, numbers, numbers)
answers = positions | st.sampled_from(Status) | st.builds(Refusal, st.integers(0, 99))


def line(one: Answer) -> bytes:
    """As a firmware prints it."""
    if isinstance(one, Refusal):
        return f"$ERROR:{one.code}\n".encode()
    text = f"{one.x:.6f},{one.y:.6f},{one.yaw:.6f}" if isinstance(one, Position) else str(int(one))
    return f"${text}\n".encode()


def same(a: Answer, b: Answer) -> bool:
    if isinstance(a, Position) and isinstance(b, Position):
        return (a.x, a.y, a.yaw) == pytest.approx((b.x, b.y, b.yaw), abs=1e-6)
    return a == b


@given(st.sampled_from(Word), st.lists(st.floats(-1e4, 1e4), max_size=3))
def test_commands_say_what_they_are_given(word: Word, arguments: list[float]) -> None:
    match = COMMAND.fullmatch(command(word, *arguments).decode().removesuffix("\n"))
    assert match is not None and match[1] == word
    assert [float(a) for a in match[2].split(",") if a] == pytest.approx(arguments, abs=5.1e-7)
    assert "-0.000000" not in match[2].split(",")


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_commands_are_finite(value: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        command(Word.RUN, 0, value, 0)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("$0.1,-0.2,3", Position(0.1, -0.2, 3)),
        ("$0.1,+0.5,0\r", Position(0.1, 0.5, 0)),
        ("$0", Status.IDLE),
        ("$8\r", Status.FAULT),
        ("$9", None),
        ("$ERROR:8", Refusal(8)),
        ("$ERROR:10\r", Refusal(10)),
        ("$ERROR:8,1", None),
        ("$ERROR:-1", None),
        ("$STOP:1", None),
        ("$-1", None),
        ("$1.0", None),
        ("$01", None),
        ("1", None),
        ("$", None),
        ("$1,2", None),
        ("$1,2,3,4", None),
        ("$1,2,99", None),
        ("$1,2,", None),
        ("$nan,1,1", None),
        ("$ 1", None),
        ("$STATUS", None),
        ("$1_0,1,1", None),
        ("$\u0661", None),
    ],
)
def test_answers(text: str, found: Position | Status | Refusal | None) -> None:
    assert answer(text) == found


@given(st.lists(answers, max_size=8), st.lists(st.integers(1, 20), min_size=1))
@pytest.mark.thorough
def test_answers_come_through_however_they_are_cut(sent: list[Answer], cuts: list[int]) -> None:
    data, lines, found = b"".join(map(line, sent)), LineReader(), []
    index = 0
    while data:
        size = cuts[index % len(cuts)]
        found += lines.feed(data[:size])
        data, index = data[size:], index + 1
    assert len(found) == len(sent) and all(map(same, found, sent))
    assert lines.garbage == 0


@given(st.binary(max_size=300).map(lambda noise: noise.replace(b"$", b"!")), answers)
def test_noise_before_an_answer_does_not_hide_it(noise: bytes, sent: Answer) -> None:
    lines = LineReader()
    found = lines.feed(noise) + lines.feed(b"\n" + line(sent))
    assert len(found) == 1 and same(found[0], sent)


def test_a_line_without_end_is_dropped_whole() -> None:
    lines = LineReader()
    for _ in range(10):
        assert lines.feed(b"1" * LONGEST) == []
    assert lines.feed(b"$1\n") == []
    assert lines.feed(b"$1\n") == [Status.MOVING]
    assert lines.garbage == 1


def test_a_line_that_broke_off_does_not_spoil_the_next() -> None:
    lines = LineReader()
    assert lines.feed(b"$0.12,0.3$0.5,0.5,0.5\n") == [Position(0.5, 0.5, 0.5)]
