"""What an application prints and declares as messages: lines become envelopes, which the runner sends for it.

They come from the runner's address in the test: the application can send none of them itself. What matches nothing is
log. Lines are matched in a thread of the test's own: RE2 lets the runner go on meanwhile.
"""

import asyncio
import math
import re
import struct
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from dodo_dsl.application.printed_lines import SAMPLE_TIME, compiled
from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.odvd import INTEGER_BITS, integer_range
from dodo_dsl.opendlv.relay import BUS
from dodo_dsl.plan.added_services import CLOCK, RECORDER
from dodo_dsl.plan.model import Line, Plan
from dodo_dsl.run.announce import frame_of
from dodo_dsl.run.protocol import Say

MAX_LINE = 1 << 16
"""Bytes; what is longer is log."""
MAX_PAYLOAD = 1 << 15
"""Bytes of a message that a line may make."""
_MOST_WAITING = 50_000
"""Messages of a service in a step; the clock takes far fewer."""
LINES_READ = "dodo.LinesRead"
_WIDTH = 200
_INTEGER = re.compile(rb"[-+]?[0-9]{1,20}")
_NUMBER = re.compile(rb"[-+]?(([0-9]+\.?[0-9]*|\.[0-9]+)(e[-+]?[0-9]+)?|nan|inf(inity)?)", re.IGNORECASE)
_UNITS = {"us": 1, "ms": 1000, "s": 1_000_000}
_TIME = re.compile(rb"[0-9]{1,20}(\.[0-9]{1,20})?")
_BOOLEANS = {b"1": True, b"true": True, b"0": False, b"false": False}
_END_OF_TIME = 1_000_000 << 31
"""Microseconds; an envelope's seconds have 32 bits with a sign."""
_FOR_TERMINALS = re.compile(
    rb"\x1b(\[[0-?]*[ -/]*[@-~]"  # CSI, such as colours
    rb"|[]PX^_][^\x07\x1b]*(\x07|\x1b\\)?"  # OSC and other strings, such as titles and links
    rb"|[ -/]*[0-Z\\^-~])"
)
"""Control sequences of ECMA-48."""


def value(type_: str, text: bytes) -> Any:
    """The value of a field of a type of messages; raises ValueError, which says why there is none."""
    try:
        if type_ in ("float", "double") and _NUMBER.fullmatch(text):
            struct.pack("<f" if type_ == "float" else "<d", found := float(text))
            if not math.isinf(found) or b"i" in text.lower():  # inf, infinity
                return found
        elif type_ == "char":
            (found,) = text
            return found
        elif type_ in INTEGER_BITS and _INTEGER.fullmatch(text) and int(text) in integer_range(type_):
            return int(text)
        elif type_ == "bool":
            return _BOOLEANS[text.lower()]
        elif type_ in ("string", "bytes"):
            return text.decode() if type_ == "string" else text
    except (OverflowError, KeyError, ValueError):  # UnicodeDecodeError is a ValueError, too
        pass
    raise ValueError(f"not a valid {type_}")


def sample_time(unit: str, text: bytes) -> int:
    """A time in microseconds, to which decimals of ``s`` and ``ms`` are rounded; raises ValueError."""
    if not _TIME.fullmatch(text) or (unit == "us" and b"." in text):
        raise ValueError("no whole number (of us, without sample-time: s)" if unit == "us" else "no number")
    found = round(Fraction(text.decode()) * _UNITS[unit])
    if found >= _END_OF_TIME:
        raise ValueError(f"not a time in {unit}")
    return found


class Printed(NamedTuple):
    """A message that a line makes; ``sample_time`` in us is None if the line has none."""

    line: Line
    id: int
    payload: bytes
    sample_time: int | None


class LinePattern:
    """One of a service's patterns, which makes messages of a set."""

    def __init__(self, line: Line, messages: MessageSet) -> None:
        self.line = line
        self._messages, self._type = messages, messages.type(line.message)
        types = {each.name: each.type for each in messages.layout(line.message).definition.fields}
        self._regexp = compiled(line.match)
        groups = {name.decode(): number for name, number in self._regexp.groupindex.items()}
        self._groups = [(name, number, types.get(name, "uint64")) for name, number in groups.items()]

    def printed(self, line: bytes) -> Printed | None:
        """The message of a line, None if the pattern is not in it; raises ValueError."""
        match = self._regexp.search(line)
        if match is None:
            return None
        values: dict[str, Any] = {}
        for name, number, type_ in self._groups:
            text = match.group(number)
            if text is None:
                continue  # of another alternative
            try:
                own = name == SAMPLE_TIME
                values[name] = sample_time(self.line.sample_time, text) if own else value(type_, text)
            except ValueError as error:
                raise ValueError(f"{name} '{_shown(text)}' is {error}") from None
        sampled = values.pop(SAMPLE_TIME, None)
        message = self._type(**values)
        payload = self._messages.encode(message)
        if len(payload) > MAX_PAYLOAD:
            raise ValueError(f"it has more than {MAX_PAYLOAD} bytes")
        return Printed(self.line, self._messages.id(message), payload, sampled)


@dataclass
class ServiceLines:
    service: str
    patterns: Sequence[LinePattern]
    has_matched: bool = False
    last: bytes = b""
    notes: dict[str, str] = field(default_factory=dict)
    """By what is wrong, as each is said once; empty when it was."""
    is_over: bool = False

    def take(self, lines: Iterable[bytes]) -> list[Printed]:
        """The messages of lines, as many as patterns match; colours and what was written over do not count."""
        found = list[Printed]()
        for line in lines:
            for part in _FOR_TERMINALS.sub(b"", line).split(b"\r") if len(line) <= MAX_LINE else ():
                made = [] if self.is_over else self._printed(part)
                self.has_matched |= bool(made)
                self.last = part if part.strip() and not made else self.last
                found += made
        return found

    def _printed(self, line: bytes) -> list[Printed]:
        found = []
        for pattern in self.patterns:
            try:
                printed = pattern.printed(line)
            except ValueError as error:
                what = f"is not a valid {pattern.line.message}"
                key = f"{what} {str(error).partition(' ')[0]}"
                self.notes.setdefault(key, f"a line of '{self.service}' {what}: {error}: '{_shown(line)}'")
                continue
            if printed is not None:
                found.append(printed)
        return found

    def silence(self) -> str:
        """What it printed instead of a match, in words; empty after one."""
        said = f"no line of '{self.service}' matched, the last is '{_shown(self.last)}'"
        return "" if self.has_matched else said if self.last else f"'{self.service}' printed no line"


class Send(Protocol):
    """Sends a datagram to a test's services by their names, or on its bus."""

    def __call__(self, data: bytes, to: Sequence[str] = (BUS,)) -> None: ...


class PrintedLines:
    """The lines of a test's application; ``note`` is called with a sentence about one that makes no message.

    Before the application starts, ``connect`` sets the sender. Messages are sent as they come until the clock of the
    test asks for them: then they wait for its next question, and are of the time that it names.
    """

    def __init__(self, plan: Plan, folder: Path, note: Say) -> None:
        """``folder`` is the compiled test's, with its messages."""
        declared = {s.name: s.lines for s in plan.application.services if s.lines}
        own = (folder / FILES / path for path in plan.messages)
        self._messages = MessageSet.load(*own) if declared else MessageSet.standard()
        self._note = note
        self.services = {
            name: ServiceLines(name, [LinePattern(line, self._messages) for line in lines])
            for name, lines in declared.items()
        }
        self._hearers = {line: _hearers(plan, name, line) for name, lines in declared.items() for line in lines}
        self._matcher = ThreadPoolExecutor(1, "lines")
        self._waiting: dict[str, list[Printed]] | None = None
        self._send: Send = lambda data, to=(BUS,): None

    def connect(self, send: Send) -> None:
        self._send = send

    async def match(self, service: str, lines: Sequence[bytes]) -> None:
        """Takes lines that a service printed, without their ends, and makes messages of them."""
        own = self.services[service]
        found = [] if own.is_over else await asyncio.get_running_loop().run_in_executor(self._matcher, own.take, lines)
        for key, text in own.notes.items():
            if text:
                self._note(text)
                own.notes[key] = ""
        if self._waiting is None:
            self._send_all(found, None)
        elif len(waiting := self._waiting.setdefault(service, [])) < _MOST_WAITING:
            self._waiting[service] = _counting([*waiting, *found])

    def rest(self, now: int, goes_on: bool) -> None:
        """The application rests at a time of the test (us), unless it ``goes_on``: sends what it has printed.

        Where its other programs get that, too, it goes on once more.
        """
        waiting, self._waiting = self._waiting or {}, {}
        if goes_on:
            self._waiting = waiting
        else:
            found = [each for name in self.services for each in waiting.get(name, ())]
            self._send_all(found, now)
            goes_on = any(BUS in self._hearers[each.line] for each in found)
        self._send(frame_of(MessageSet.standard().type(LINES_READ)(goesOn=goes_on), now), [CLOCK])

    def _send_all(self, found: Iterable[Printed], now: int | None) -> None:
        sent = time.time_ns() // 1000 if now is None else now
        for line, id_, payload, sampled in found:
            envelope = Envelope(id_, payload, sent, 0, sent if sampled is None else sampled, line.sender)
            self._send(encode_frame(envelope), self._hearers[line])

    def close(self) -> None:
        for each in self.services.values():
            each.is_over = True
        self._matcher.shutdown(wait=False, cancel_futures=True)

    def unmatched(self) -> list[str]:
        """Of each service of which no line matched what it printed instead, in words."""
        return [words for each in self.services.values() if (words := each.silence())]


def _shown(text: bytes) -> str:
    decoded = text[:_WIDTH].decode("utf-8", "replace")
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in decoded)


def _counting(found: Sequence[Printed]) -> list[Printed]:
    """Those that count of a service's messages in a step."""
    last = {each.line: number for number, each in enumerate(found)}
    first = {each.line: len(found) - 1 - number for number, each in enumerate(reversed(found))}
    kept = {"first": first, "last": last}
    return [each for n, each in enumerate(found) if kept.get(each.line.take, {each.line: n})[each.line] == n]


def _hearers(plan: Plan, service: str, line: Line) -> list[str]:
    """Who gets the messages of a line: services of the test, or all on the bus where another program may take them.

    There the program itself hears what it printed, unlike one that sends. One that declares nothing may take anything.
    """
    names = [CLOCK, RECORDER] if plan.lockstep else [each.name for each in plan.services]
    others = [each for each in plan.application.services if each.name != service]
    taken = {line.message, f"{line.message}/{line.sender}"}
    is_taken = any(not (o.inputs or o.outputs) or not taken.isdisjoint(o.inputs) for o in others)
    return [BUS] if is_taken else names
