"""The protocol of services on standard output: JSON lines with the key ``dodo`` are for the runner, others are log."""

import dataclasses
import json
import math
import re
from typing import Any

from dodo_dsl.opendlv.address import Address
from dodo_dsl.outcome import Response, with_margin
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
_OUTCOMES = ("passed", "failed")
_STOPS = ("unanswered", "stuck", "timedout")
_MAX_TEXT = 2000
_CHECK_KEYS = {"name", "value", "limit", "unit", "ok"}
_OPTIONAL_CHECK_KEYS = {"exclusive"}
_ADDRESS = re.compile(r"(?P<host>[0-9]{1,3}(\.[0-9]{1,3}){3}):(?P<port>[0-9]{1,5})", re.ASCII)
_UNASKED = ("surplus", "surplus_frames", "differing", "pauses", "unasked")
"""Counts of what no frame asked for."""
_EVIDENCE_KEY = re.compile(r"[a-z][a-z0-9-]{0,39}")
_MOST_EVIDENCE, _MAX_EVIDENCE_TEXT = 20, 200


def read_line(service: str, is_evaluator: bool, line: bytes) -> Event | None:
    """The event that a line represents, or None for a line of log; only evaluators give verdicts, and record."""
    text = line.strip()
    if text.startswith(JUDGED):  # its JSON is the report's to read
        return Recorded(service) if is_evaluator else None
    if not text.startswith(b"{") or b'"dodo"' not in text:
        return None
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        return Malformed(service, "its JSON cannot be read") if is_evaluator and b'"verdict"' in text else None
    if not isinstance(message, dict):
        return None
    kind = message.get("dodo")
    if kind == "ready":
        return Ready(service, _address(message.get("address")))
    if kind == "end-of-input":
        return InputEnded(service)
    if kind in ("note", "foreign", "taken"):
        return _told(service, message)
    if kind == "lost" and type(message.get("messages")) is int and 0 < message["messages"] < 1 << 63:
        return Overrun(service, message["messages"])
    if kind in ("late", "paused"):
        return _late(service, message) if kind == "late" else _paused(service, message.get("s"))
    if kind == "verdict" and is_evaluator:
        if problem := _problem(message):
            return Malformed(service, problem)
        passed, evidence = message["outcome"] == "passed", message.get("evidence", {})
        return VerdictEvent(service, passed, message["reason"], tuple(map(with_margin, message["checks"])), evidence)
    if kind == "flood" and service == RECORDER:
        return _flood(service, message)
    return _clock_event(kind, message) if service == CLOCK else None


def _address(text: object) -> Address | None:
    """An IPv4 address with a port, None if it is none."""
    found = _ADDRESS.fullmatch(text) if isinstance(text, str) else None
    return (found["host"], int(found["port"])) if found and 0 < int(found["port"]) < 1 << 16 else None


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


def _response(message: dict[str, Any]) -> Responded | None:
    """How long the application took, where all of the numbers can be."""
    facts: dict[str, Any] = {field.name: message.get(field.name) for field in dataclasses.fields(Response)}
    facts |= {name: message.get(name, 0) for name in ("uncopied", "worst_frame", *_UNASKED)}
    counts = [facts["answers"], facts["slow"], facts["over"] or 0, facts["uncopied"]]
    times = [value for name, value in facts.items() if name.endswith("_s")]
    if not all(type(count) is int and 0 <= count <= counts[0] for count in counts) or counts[0] == 0:
        return None
    if not all(type(facts[name]) is int and 0 <= facts[name] < 1 << 63 for name in _UNASKED):
        return None
    if type(facts["worst_frame"]) is not int or not 0 <= facts["worst_frame"] <= counts[0] + 1:
        return None
    if not all(_is_number(time, none=True) and (time or 0) >= 0 for time in times) or None in times[:4]:
        return None
    name = facts["processor"]
    return Responded(Response(**{**facts, "processor": name if _is_text(name) else ""}))


def _problem(message: dict[str, Any]) -> str:
    if message.get("outcome") not in _OUTCOMES:
        return f"its outcome is {json.dumps(message.get('outcome'))[:40]}, expected passed or failed"
    if not _is_text(message.get("reason")):
        return f"its reason is not a string of 1 to {_MAX_TEXT} characters of UTF-8"
    checks = message.get("checks")
    if not isinstance(checks, list):
        return "its checks are not a list"
    return next((p for p in map(_check_problem, checks) if p), "") or _evidence_problem(message.get("evidence", {}))


def _evidence_problem(evidence: object) -> str:
    """What is wrong with the data of a decision."""
    if not isinstance(evidence, dict) or len(evidence) > _MOST_EVIDENCE:
        return f"its evidence is not an object of at most {_MOST_EVIDENCE} values"
    for key, value in evidence.items():
        if not _EVIDENCE_KEY.fullmatch(key):
            return f"its evidence has a key {json.dumps(key)[:50]}, expected lower-case words with hyphens"
        if not _is_number(value, none=True) and not (_is_text(value) and len(value) <= _MAX_EVIDENCE_TEXT):
            return f"'{key}' of its evidence is neither a finite number nor a short string nor null"
    return ""


def _check_problem(check: object) -> str:
    if not isinstance(check, dict) or not _is_text(check.get("name")):
        return "a check has no name"
    name = check["name"]
    surplus = set(check) - _CHECK_KEYS - _OPTIONAL_CHECK_KEYS
    missing = _CHECK_KEYS - set(check)
    if missing:
        return f"check '{name}' has no key '{min(missing)}'"
    if surplus:
        return f"check '{name}' has an unknown key '{min(surplus)}'"
    if not _is_number(check.get("value"), none=True):
        return f"the value of check '{name}' is not a finite number"
    if not isinstance(check["unit"], str) or not _is_text(check["unit"] or "1"):
        return f"the unit of check '{name}' is not a string"
    limit = check["limit"]
    if not isinstance(limit, dict) or not all(k in ("min", "max") and _is_number(v) for k, v in limit.items()):
        return f"the limit of check '{name}' is not an object of numbers 'min' and 'max'"
    for key in ("ok", "exclusive"):
        if not isinstance(check.get(key, False), bool):
            return f"check '{name}': '{key}' is neither true nor false"
    return ""


def _is_number(value: object, none: bool = False) -> bool:
    if value is None:
        return none
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False


def _is_text(value: object) -> bool:
    """Whether a value is a string that UTF-8 can encode, of a length that a report can show."""
    if not isinstance(value, str) or not 0 < len(value) <= _MAX_TEXT:
        return False
    return not any("\ud800" <= character <= "\udfff" for character in value)
