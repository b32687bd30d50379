"""The protocol of services on standard output: JSON lines with the key ``dodo`` are for the runner, others are log."""

import json
import math
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from dodo_dsl.outcome import Evidence, Response, with_margin
from dodo_dsl.plan.added_services import CLOCK, RECORDER
from dodo_dsl.run.protocol import (
    Event,
    Flooded,
    Foreign,
    InputEnded,
    Late,
    Malformed,
    MemoryTaken,
    Noted,
    Overrun,
    Paused,
    Ready,
    Recorded,
    Responded,
    Stopped,
    Time,
    VerdictEvent,
)

JUDGED = b'{"dodo": "judged"'
_STOPS = ("unanswered", "stuck", "timedout")
_MAX_TEXT = 2000


def read_line(service: str, is_evaluator: bool, line: bytes) -> Event | None:
    """The event that a line represents, or None for a line of log; only evaluators give verdicts, and record."""
    text = line.strip()
    if text.startswith(JUDGED):  # its JSON is the report's to read
        return Recorded(service) if is_evaluator else None
    if not text.startswith(b"{") or b'"dodo"' not in text:
        return None
    try:
        message = json.loads(text, parse_int=_finite, parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError):
        return Malformed(service, "its JSON cannot be read") if is_evaluator and b'"verdict"' in text else None
    if not isinstance(message, dict):
        return None
    kind = message.get("dodo")
    if kind == "ready":
        return Ready(service)
    if kind == "end-of-input":
        return InputEnded(service)
    if kind in ("note", "foreign", "taken"):
        return _told(service, message)
    if kind == "lost" and type(message.get("messages")) is int and 0 < message["messages"] < 1 << 63:
        return Overrun(service, message["messages"])
    if kind in ("late", "paused"):
        return _late(service, message) if kind == "late" else _paused(service, message.get("s"))
    if kind == "verdict" and is_evaluator:
        return _verdict(service, message)
    if kind == "flood" and service == RECORDER:
        return _flood(service, message)
    return _clock_event(kind, message) if service == CLOCK else None


def _told(service: str, message: dict[str, Any]) -> Event | None:
    """What a service says in a sentence."""
    kind = message["dodo"]
    text = message.get("reason" if kind == "foreign" else "text")
    if not isinstance(text, str) or not _is_text(text):
        return None
    if kind == "foreign":
        return Foreign(text)
    return Noted(f"service '{service}': {text}") if kind == "note" else MemoryTaken(service, text)


def _flood(service: str, message: dict[str, Any]) -> Flooded | None:
    """The service that fills the recording, where the values can be."""
    what, name, sender, share = (message.get(key) for key in ("what", "message", "sender", "share"))
    if not (_is_text(what) and _is_text(name) and type(sender) is int and _is_number(share)):
        return None
    return Flooded(service, str(what), str(name), sender, float(share or 0.0), message.get("limit") == "rate")


def _late(service: str, message: dict[str, Any]) -> Late | None:
    """How late a service is, where the numbers can be."""
    updates, late, worst = message.get("updates"), message.get("late"), message.get("worst_s", 0.0)
    if type(updates) is not int or type(late) is not int or not 0 < late <= updates < 1 << 63:
        return None
    return Late(service, updates, late, float(worst)) if _is_number(worst) and worst >= 0 else None


def _paused(service: str, seconds: Any) -> Paused | None:
    """For how long what a service emulates stood still, where that can be."""
    return Paused(service, float(seconds)) if _is_number(seconds) and seconds > 0 else None


def _clock_event(kind: object, message: dict[str, Any]) -> Event | None:
    """How far the clock is, or why it stopped."""
    seconds, reason = message.get("s"), message.get("reason")
    if kind == "time" and _is_number(seconds):
        return Time(float(seconds or 0.0), message.get("last") is True)
    if kind == "response":
        return _response(message)
    if kind in _STOPS and isinstance(reason, str) and _is_text(reason or "none"):
        return Stopped(str(kind), reason)
    return None


_UNSEEN = dict.fromkeys(("processor_median_s", "processor_p95_s", "processor_worst_s", "over"))
"""What the clock leaves out where it cannot see the application's processes, or the test has no limit."""


def _response(message: dict[str, Any]) -> Responded | None:
    """How long the application took, where all of the numbers can be."""
    processor = message.get("processor")
    given = {**_UNSEEN, **message, "processor": processor if _is_text(processor) else ""}
    try:
        found = msgspec.convert(given, Response)
    except msgspec.ValidationError:
        return None
    counts = (found.slow, found.over or 0, found.uncopied, found.worst_frame - 1)
    return Responded(found) if max(counts) <= found.answers else None


_Text = Annotated[str, Meta(min_length=1, max_length=_MAX_TEXT)]


class _Limit(Struct, forbid_unknown_fields=True):
    min: int | float = 0
    max: int | float = 0


class _Check(Struct, forbid_unknown_fields=True):
    name: _Text
    value: int | float | None
    limit: _Limit
    unit: Annotated[str, Meta(max_length=_MAX_TEXT)]
    ok: bool
    exclusive: bool = False


class _Verdict(Struct):
    reason: _Text
    checks: list[_Check]
    evidence: Evidence = {}


def _verdict(service: str, message: dict[str, Any]) -> Event:
    """The verdict, or what is wrong with it; its checks stay as they are written."""
    outcome = message.get("outcome")
    if outcome not in ("passed", "failed"):
        return Malformed(service, f"its outcome is {json.dumps(outcome)[:40]}, expected passed or failed")
    try:
        msgspec.convert(message, _Verdict)
        json.dumps(message, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        return Malformed(service, "it has characters that UTF-8 cannot encode")
    except msgspec.ValidationError as error:
        return Malformed(service, str(error))
    evidence = message.get("evidence", {})
    return VerdictEvent(
        service, outcome == "passed", message["reason"], tuple(map(with_margin, message["checks"])), evidence
    )


def _finite(text: str) -> Any:
    """A number; what is none, or what no float holds, is a list, which may stand nowhere."""
    number = float(text)
    return [] if not math.isfinite(number) else int(text) if text.lstrip("-").isdecimal() else number


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_text(value: object) -> bool:
    """Whether a value is a string that UTF-8 can encode, of a length that a report can show."""
    if not isinstance(value, str) or not 0 < len(value) <= _MAX_TEXT:
        return False
    return not any("\ud800" <= character <= "\udfff" for character in value)
