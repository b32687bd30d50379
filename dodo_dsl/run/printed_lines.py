"""What an application prints and declares as messages: lines become envelopes, which the runner sends for it.

They come from the runner's address in the test: the application can send none of them itself. What matches nothing is
log.
"""

import difflib
import math
import re
import struct
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from dodo_dsl.application.printed_lines import SAMPLE_TIME, compiled
from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.odvd import INTEGER_BITS, integer_range
from dodo_dsl.plan.model import Line, Plan
from dodo_dsl.run.announce import frame_of
from dodo_dsl.run.protocol import Unmatched

MAX_LINE = 1 << 16
"""Bytes; what is longer is log."""
MAX_FRAME = 1 << 15
"""Bytes of a message that a line may make."""
_MOST_UNMATCHED, _WIDTH = 100, 200
_AGAIN_S = 0.5
"""How often the runner's address is said again, while lines come: a datagram may be lost."""
_INTEGER = re.compile(rb"[-+]?[0-9]{1,20}")
_NUMBER = re.compile(rb"[-+]?(([0-9]+\.?[0-9]*|\.[0-9]+)(e[-+]?[0-9]+)?|nan|inf(inity)?)", re.IGNORECASE)
_BOOLEANS = {b"1": True, b"true": True, b"0": False, b"false": False}
_END_OF_TIME = 1_000_000 << 31
"""Microseconds; an envelope's seconds have 32 bits with a sign."""
_FOR_TERMINALS = re.compile(
    rb"\x1b(\[[0-?]*[ -/]*[@-~]"  # CSI, such as colours
    rb"|[]PX^_][^\x07\x1b]*(\x07|\x1b\\)?"  # OSC and other strings, such as titles and links
    rb"|[ -/]*[0-Z\\^-~])"
)
"""Control sequences of ECMA-48."""
_GROUP = re.compile(r"\(\?P<[^>]*>|[][()?*+|^$\\]|\{[0-9,]*\}")


class NoValue(ValueError):
    """A printed text does not fit its field; the message says why."""


def value(type_: str, text: bytes) -> Any:
    """The value of a field of a type of messages; raises NoValue."""
    if type_ in ("float", "double"):
        return _float(type_, text)
    if type_ == "char":
        if len(text) != 1:
            raise NoValue("no single character")
        return text[0]
    if type_ in INTEGER_BITS:
        if not _INTEGER.fullmatch(text):
            raise NoValue("no whole number")
        if int(text) not in integer_range(type_):
            raise NoValue(f"out of range for {type_}")
        return int(text)
    if type_ == "bool":
        if text.lower() not in _BOOLEANS:
            raise NoValue("neither true nor false")
        return _BOOLEANS[text.lower()]
    if type_ == "string":
        try:
            return text.decode()
        except UnicodeDecodeError:
            raise NoValue("no UTF-8") from None
    return text


def _float(type_: str, text: bytes) -> float:
    if not _NUMBER.fullmatch(text):
        raise NoValue("no number")
    found = float(text)
    is_meant = b"i" in text.lower()  # inf, infinity
    try:
        struct.pack("<f" if type_ == "float" else "<d", found)
    except OverflowError:
        raise NoValue(f"out of range for {type_}") from None
    if math.isinf(found) and not is_meant:
        raise NoValue(f"out of range for {type_}")
    return found


class Printed(NamedTuple):
    """A message that a line makes; ``sample_time`` in us is None if the line has none."""

    message: Any
    sender: int
    sample_time: int | None


class LinePattern:
    """One of a service's patterns, which makes messages of a set."""

    def __init__(self, line: Line, messages: MessageSet) -> None:
        self.line = line
        self._type = messages.type(line.message)
        types = {each.name: each.type for each in messages.layout(line.message).definition.fields}
        self._regexp = compiled(line.match)
        groups = {name.decode(): number for name, number in self._regexp.groupindex.items()}
        self._groups = [(name, number, types.get(name, "uint64")) for name, number in groups.items()]

    def printed(self, line: bytes) -> Printed | None:
        """The message of a line, None if the pattern is not in it; raises NoValue."""
        match = self._regexp.search(line)
        if match is None:
            return None
        values, sampled = {}, None
        for name, number, type_ in self._groups:
            text = match.group(number)
            if text is None:
                continue  # of another alternative
            try:
                values[name] = value(type_, text)
            except NoValue as error:
                raise NoValue(f"{name} '{_shown(text)}' is {error}") from None
        if SAMPLE_TIME in values:
            sampled = values.pop(SAMPLE_TIME)
            if sampled >= _END_OF_TIME:
                raise NoValue(f"{SAMPLE_TIME} '{sampled}' is not a time in microseconds")
        return Printed(self._type(**values), self.line.sender, sampled)


@dataclass
class ServiceLines:
    """The lines of one service so far: the last one that matched, and those that did not since."""

    service: str
    patterns: Sequence[LinePattern]
    matched: int = 0
    last: bytes = b""
    unmatched: deque[bytes] = field(default_factory=lambda: deque(maxlen=_MOST_UNMATCHED))
    said: set[str] = field(default_factory=set)

    def take(self, line: bytes, note: Callable[[str], None]) -> list[Printed]:
        """The messages of a line, as many as patterns match; what cannot be converted is said once.

        Where the terminal made a program colour it, or write over it, it is matched as without, then as it is.
        """
        parts, found = [line], list[Printed]()
        if (b"\x1b" in line or b"\r" in line) and len(line) <= MAX_LINE:
            parts = _FOR_TERMINALS.sub(b"", line).split(b"\r")
            for part in parts:
                found += self._printed(part, note)
        found = found or self._printed(line, note)
        if found:
            self.matched += 1
            self.last = parts[-1][:_WIDTH]
            self.unmatched.clear()
            return found
        for part in parts:
            if part.strip():
                self.unmatched.append(part[:_WIDTH])
        return found

    def _printed(self, line: bytes, note: Callable[[str], None]) -> list[Printed]:
        found = []
        for pattern in self.patterns if len(line) <= MAX_LINE else ():
            try:
                printed = pattern.printed(line)
            except NoValue as error:
                key, _, _ = str(error).partition(" ")
                what = f"is not a valid {pattern.line.message}"
                self.say_once(f"{what} {key}", f"{what}: {error}: '{_shown(line)}'", note)
                continue
            if printed is not None:
                found.append(printed)
        return found

    def say_once(self, key: str, what: str, note: Callable[[str], None]) -> None:
        """What is wrong with a line, unless the same is said already, by its ``key``."""
        if key not in self.said:
            self.said.add(key)
            note(f"a line of '{self.service}' {what}")

    def silence(self, unfinished: bytes = b"") -> str:
        """What it printed instead of a match since the last one, in words."""
        since = "since its last match " if self.matched else ""
        if unfinished.strip():
            return f"{since}'{self.service}' printed a line without its end: '{_shown(unfinished)}'"
        if not self.unmatched:
            return f"{since}'{self.service}' printed no line"
        return f"{since}no line of '{self.service}' matched, the nearest is '{_shown(self._nearest())}'"

    def _nearest(self) -> bytes:
        """The line that is most like one that matched, or like a pattern; of equal ones the last."""
        likes = [self.last] if self.last else [_GROUP.sub("", p.line.match).encode() for p in self.patterns]

        def likeness(line: bytes) -> float:
            return max(difflib.SequenceMatcher(None, line, like, autojunk=False).ratio() for like in likes)

        return max(reversed(self.unmatched), key=likeness)


class PrintedLines:
    """The lines of a test's application; ``note`` is called with a sentence about one that makes no message.

    Before the application starts, ``connect`` sets the sender.
    """

    def __init__(self, plan: Plan, folder: Path, note: Callable[[str], None]) -> None:
        """``folder`` is the compiled test's, with its messages."""
        declared = {s.name: s.lines for s in plan.application.services if s.lines}
        own = (folder / FILES / path for path in plan.messages)
        self._messages = MessageSet.load(*own) if declared else MessageSet.standard()
        self._note = note
        self.services = {
            name: ServiceLines(name, [LinePattern(line, self._messages) for line in lines])
            for name, lines in declared.items()
        }
        self._send: Callable[[bytes], None] = lambda _: None

    def __bool__(self) -> bool:
        return bool(self.services)

    def connect(self, send: Callable[[bytes], None]) -> None:
        """``send`` sends a frame on the test's bus."""
        self._send = send

    def take(self, service: str, line: bytes) -> None:
        """A line that a service printed, without its end."""
        for printed in self.services[service].take(line.rstrip(b"\r"), self._note):
            frame = frame_of(printed.message, self._messages, printed.sample_time, printed.sender)
            if len(frame) > MAX_FRAME:
                what = f"makes a message of more than {MAX_FRAME} bytes, which is not sent"
                self.services[service].say_once(what, what, self._note)
                continue
            self._send(frame)

    def unmatched(self, unfinished: Mapping[str, bytes]) -> tuple[Unmatched, ...]:
        """Of each service what it printed since its last match; ``unfinished`` are their last lines without an end."""
        return tuple(
            Unmatched(name, each.silence(unfinished.get(name, b"")), each.matched == 0)
            for name, each in self.services.items()
        )


def _shown(text: bytes) -> str:
    decoded = text[:_WIDTH].decode("utf-8", "replace")
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in decoded)
