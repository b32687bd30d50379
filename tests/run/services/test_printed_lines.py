"""What an application prints as messages: the values of fields, what makes none, and what is said of silence."""

import asyncio
import math
import random
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.application.printed_lines import PatternError, compiled
from dodo_dsl.opendlv.envelope import Envelope, decode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.plan.model import Line
from dodo_dsl.run.printed_lines import PrintedLines, sample_time, value
from tests.run.helpers import Bench

STEERING = "opendlv.proxy.GroundSteeringRequest"
GROUP_06 = Line("group_[0-9]+;(?P<sample_time>[0-9]+);(?P<groundSteering>[-+.0-9eE]+)", STEERING)
TYPES = """
message t.Inner [id = 5101] { int32 a [id = 1]; }
message t.All [id = 5100] {
  bool b [id = 1]; char c [id = 2]; uint8 u8 [id = 3]; int8 i8 [id = 4]; int64 i64 [id = 5]; uint64 u64 [id = 6];
  float f [id = 7]; double d [id = 8]; string s [id = 9]; bytes raw [id = 10];
}
"""


class Desk:
    """The lines of one application service 'app', what they sent, and what was said."""

    def __init__(self, folder: Path, *lines: Line, messages: str = "") -> None:
        plan = Bench(folder).plan()
        (app,) = plan.application.services
        application = replace(plan.application, services=(replace(app, lines=lines),))
        if messages:
            (folder / "files").mkdir()
            (folder / "files" / "own.odvd").write_text(messages)
        plan = replace(plan, application=application, messages=("own.odvd",) if messages else ())
        self.said: list[str] = []
        self.sent: list[Envelope] = []
        self.messages = MessageSet.load(*([folder / "files" / "own.odvd"] if messages else []))
        self.lines = PrintedLines(plan, folder, self.said.append)
        self.lines.connect(lambda frame, to=(): self.sent.append(decode_frame(frame)))

    def print(self, *lines: bytes) -> list[tuple[int, int, dict[str, object]]]:
        """Sample time, sender stamp and fields of what lines made at once."""
        del self.sent[:]
        asyncio.run(self.lines.match("app", lines))
        return self.messages_sent()

    def messages_sent(self) -> list[tuple[int, int, dict[str, object]]]:
        return [(e.sample_time, e.sender_stamp, fields(self.messages, e)) for e in self.sent]

    def rest(self, now: int) -> list[tuple[int, int, dict[str, object]]]:
        """The same of what waited for a time at which the application rests."""
        del self.sent[:]
        self.lines.rest(now, goes_on=False)
        read = self.sent.pop()
        assert fields(self.messages, read) == {"goesOn": False}
        assert {each.sent for each in self.sent} <= {now}  # so that recordings are equal
        return self.messages_sent()


def fields(messages: MessageSet, envelope: Envelope) -> dict[str, object]:
    message = messages.decode(envelope.data_type, envelope.payload)
    return {field.name: getattr(message, field.name) for field in message.DESCRIPTOR.fields}


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path, GROUP_06)


@pytest.mark.parametrize(
    "line",
    [
        b"group_06;1584542902573412;0.25",
        b"group_06;1584542902573412;0.25\r",
        b"INFO \x00\xff group_06;1584542902573412;25e-2 and more",
    ],
)
def test_a_line_is_a_message(desk: Desk, line: bytes) -> None:
    assert desk.print(line) == [(1584542902573412, 0, {"groundSteering": 0.25})]


@pytest.mark.parametrize(
    "line", [b"", b"group_06", b"group_06;;0.25", b"group_06;1;", b"x" * 70_000 + b"group_06;1;0.25", b"\xff\x00"]
)
def test_what_matches_nothing_is_no_message(desk: Desk, line: bytes) -> None:
    assert (desk.print(line), desk.said) == ([], [])


CODES = (
    b"\x1b[32m", b"\x1b[m", b"\x1b[38;2;1;22;3m", b"\x1b[2K", b"\x1b[?25l", b"\x1b(B", b"\x1b7", b"\x1b=", b"\x1bM",
    b"\x1b]0;group_06;1;7\x07", b"\x1b]8;;http://host\x1b\\", b"\x1bPq\x1b\\",
)  # fmt: skip
"""What programs write to a terminal beside their text."""


def test_lines_for_a_terminal_are_the_messages_of_plain_ones(desk: Desk) -> None:
    chosen = random.Random(7)
    for _ in range(200):
        line = b"group_%02d;%d;%.3f" % (chosen.randrange(99), chosen.randrange(10**9), chosen.uniform(-1, 1))
        plain, cuts = desk.print(line), sorted(chosen.randrange(len(line) + 1) for _ in range(6))
        parts = [line[begin:end] for begin, end in zip([0, *cuts], [*cuts, len(line)], strict=True)]
        coloured = b"".join(part + chosen.choice(CODES) for part in parts)
        bar = chosen.choice((b"", b"\r", b"10 %\r20 %\x1b[K\r", b"\x1b[31m99\x1b[m\r"))
        assert len(plain) == 1
        assert desk.print(bar + coloured) == plain


@pytest.mark.parametrize(
    ("type_", "text", "expected"),
    [
        ("float", b"-.5e1", -5.0),
        ("float", b"1e39", "not a valid float"),
        ("double", b"1e999", "not a valid double"),
        ("double", b"inf", math.inf),
        ("double", b"1_0", "not a valid double"),
        ("double", "\N{ARABIC-INDIC DIGIT ONE}".encode(), "not a valid double"),
        ("uint8", b"256", "not a valid uint8"),
        ("int8", b"-129", "not a valid int8"),
        ("uint64", b"18446744073709551616", "not a valid uint64"),
        ("bool", b"TRUE", True),
        ("bool", b"yes", "not a valid bool"),
        ("char", b"xy", "not a valid char"),
        ("string", b"\xff", "not a valid string"),
    ],
)
def test_values_of_fields(type_: str, text: bytes, expected: object) -> None:
    try:
        found = value(type_, text)
    except ValueError as error:
        found = str(error)
    assert (type(found), found) == (type(expected), expected)


@pytest.mark.parametrize(
    ("unit", "text", "expected"),
    [
        ("us", b"1700000000100000.5", "no whole number (of us, without sample-time: s)"),
        ("ms", b"1700000000100.0009", 1700000000100001),
        ("s", b"1700000000.100000", 1700000000100000),
        ("s", b"1700000000.099999905", 1700000000100000),
        ("s", b"1.7e9", "no number"),
        ("s", b"1700000000100000", "not a time in s"),
    ],
)
def test_sample_times_are_exact_in_their_unit(unit: str, text: bytes, expected: object) -> None:
    try:
        found: object = sample_time(unit, text)
    except ValueError as error:
        found = str(error)
    assert found == expected


@pytest.mark.parametrize(("take", "kept"), [("all", [1, 2, 3]), ("first", [1]), ("last", [3])])
def test_lines_wait_for_the_step_in_which_their_program_rests(tmp_path: Path, take: str, kept: list[int]) -> None:
    """Once the clock has asked; the sample time is that of the step where a line has none."""
    desk = Desk(tmp_path, replace(GROUP_06, take=take), Line("s=(?P<groundSteering>[0-9]+)", STEERING, 1))
    assert len(desk.print(b"group_06;7;0.5")) == 1
    assert desk.rest(100) == []
    assert desk.print(b"group_06;1;0.5", b"s=4", b"group_06;2;0.5", b"group_06;3;0.5") == []
    desk.lines.rest(200, goes_on=True)
    made = desk.rest(200)
    assert [sampled for sampled, stamp, _ in made if not stamp] == kept
    assert (200, 1, {"groundSteering": 4.0}) in made
    assert desk.rest(300) == []


@pytest.mark.parametrize(
    ("inputs", "heard"), [((), True), ((f"{STEERING}/0",), True), (("opendlv.proxy.PedalPositionRequest",), False)]
)
def test_only_another_program_that_may_take_it_makes_a_message_come_to_the_bus(
    tmp_path: Path, inputs: tuple[str, ...], heard: bool
) -> None:
    plan = Bench(tmp_path).plan()
    (app,) = plan.application.services
    own, other = replace(app, lines=(GROUP_06,), inputs=(STEERING,)), replace(app, name="other", inputs=inputs)
    for services, expected in (((own,), False), ((own, other), heard)):
        tested = replace(plan, application=replace(plan.application, services=services))
        lines, to = PrintedLines(tested, tmp_path, print), list[str]()
        lines.connect(lambda _, names=(): to.extend(names))  # noqa: B023
        asyncio.run(lines.match("app", [b"group_06;1;0.5"]))
        assert to == (["*"] if expected else [service.name for service in plan.services])


def test_fields_of_all_types_and_those_of_another_alternative(tmp_path: Path) -> None:
    names = ("b", "c", "u8", "i8", "i64", "u64", "f", "d", "s", "raw")
    pattern = "all " + " ".join(f"(?P<{name}>[^ ]*)" for name in names[:-1]) + "(?: (?P<raw>.*))?$"
    desk = Desk(tmp_path, Line(pattern, "t.All"), messages=TYPES)
    ((_, _, found),) = desk.print(b"all true x 1 -1 -2 2 0.5 nan name")
    assert math.isnan(float(str(found.pop("d"))))
    assert list(found.values()) == [True, 120, 1, -1, -2, 2, 0.5, "name", b""]


def test_what_does_not_convert_is_said_once_and_is_no_message(desk: Desk) -> None:
    late = b"group_06;99999999999999999;0.1"
    assert desk.print(b"group_06;1;0.1.2", b"group_06;2;-", late, b"group_06;3;0.5") == [
        (3, 0, {"groundSteering": 0.5})
    ]
    assert desk.said == [
        f"a line of 'app' is not a valid {STEERING}: groundSteering '0.1.2' is not a valid float: 'group_06;1;0.1.2'",
        f"a line of 'app' is not a valid {STEERING}: sample_time '99999999999999999' is not a time in us: "
        f"'{late.decode()}'",
    ]


def test_silence_in_words(desk: Desk) -> None:
    assert desk.lines.unmatched() == ["'app' printed no line"]
    desk.print(b"ready", b"group_06,1584542902573412,0.04\a", b"")
    last = "group_06,1584542902573412,0.04\N{REPLACEMENT CHARACTER}"
    assert desk.lines.unmatched() == [f"no line of 'app' matched, the last is '{last}'"]
    desk.print(b"group_06;1;0.5", b"done")
    assert desk.lines.unmatched() == []


def test_a_large_pattern_is_refused_as_the_time_of_a_line_grows_with_it_too() -> None:
    with pytest.raises(PatternError, match="instructions of RE2, expected at most 1000"):
        compiled("(?P<position>" + "(?:[ab]?){1000}" * 100 + "c)")
    assert compiled(GROUP_06.match).programsize < 100
