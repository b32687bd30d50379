"""The protocol of services on standard output: JSON lines with the key ``dodo`` are for the runner, others are log."""

import json
import math
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from dodo_dsl.outcome import Evidence, Response, with_margin
from dodo_dsl.plan.added_services import CLOCK, RECORDER
from dodo_dsl.run.protocol import (
    MOST_TEXT,
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
    Sentence,
    Stopped,
    Time,
    VerdictEvent,
)

JUDGED = b'{"dodo": "judged"'
_STOPS = ("unanswered", "stuck", "timedout")


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
    kind = str(message.get("dodo"))
    if kind == "verdict":
        return _verdict(service, message) if is_evaluator else None
    try:
        json.dumps(message, ensure_ascii=False).encode()
        return _event(service, kind, message)
    except (UnicodeEncodeError, msgspec.ValidationError):
        return None


_EVENTS: dict[str, Any] = {
    "ready": Ready, "end-of-input": InputEnded, "note": Noted, "foreign": Foreign, "taken": MemoryTaken,
    "lost": Overrun, "late": Late, "paused": Paused,
}  # fmt: skip
_OF_CLOCK: dict[str, Any] = {"time": Time, "response": Response, **dict.fromkeys(_STOPS, Stopped)}
"""What lines say, by their kind; of the clock alone the second ones."""
_FIELDS = {"dodo": "kind", "s": "seconds", "sender": "sender_stamp"}
"""Names of an event's fields, where a line has others."""
_UNSEEN = {**dict.fromkeys(("processor_median_s", "processor_p95_s", "processor_worst_s", "over")), "processor": ""}
"""What the clock leaves out where it cannot see the application's processes, or the test has no limit."""


def _event(service: str, kind: str, message: dict[str, Any]) -> Event | None:
    """Raises ValidationError."""
    known = _EVENTS | (_OF_CLOCK if service == CLOCK else {}) | ({"flood": Flooded} if service == RECORDER else {})
    if kind not in known:
        return None
    own = {"service": service, "too_fast": message.get("limit") == "rate"}
    given = {**_UNSEEN, **{_FIELDS.get(key, key): value for key, value in message.items()}, **own}
    event = msgspec.convert(given, known[kind])
    if isinstance(event, Noted):
        return Noted(f"service '{service}': {event.text}")
    if isinstance(event, Late):
        return event if event.late <= event.updates else None
    if isinstance(event, Response):
        counts = (event.slow, event.over or 0, event.uncopied, event.worst_frame - 1)
        return Responded(event) if max(counts) <= event.answers else None
    return event  # type: ignore[no-any-return]


class _Limit(Struct, forbid_unknown_fields=True):
    min: int | float = 0
    max: int | float = 0


class _Check(Struct, forbid_unknown_fields=True):
    name: Sentence
    value: int | float | None
    limit: _Limit
    unit: Annotated[str, Meta(max_length=MOST_TEXT)]
    ok: bool
    exclusive: bool = False


class _Verdict(Struct):
    reason: Sentence
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
