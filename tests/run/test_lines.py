"""Verdict lines are taken only when a report can show them."""

import json

import pytest
from dodo_dsl.run.service_lines import read_line
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.run.protocol import Malformed, Overrun, Ready, Verdict

CHECK = {"name": "time", "value": 1.5, "limit": {"max": 2}, "unit": "s", "ok": True}


def line(**changes: object) -> bytes:
    return json.dumps({"dodo": "verdict", "outcome": "passed", "reason": "done", "checks": [CHECK], **changes}).encode()


def test_a_whole_verdict_is_taken() -> None:
    assert read_line("judge", True, line()) == Verdict("judge", True, "done", (CHECK,))
    assert read_line("judge", False, line()) is None
    assert read_line("camera", False, b'{"dodo": "ready"}\n') == Ready("camera")


def test_losses_are_taken_from_every_service() -> None:
    assert read_line("recorder", False, b'{"dodo": "lost", "messages": 12}\n') == Overrun("recorder", 12)
    for count in (b"0", b"-1", b"true", b"1.5", b'"12"', b"null", b"1" * 30):
        assert read_line("judge", True, b'{"dodo": "lost", "messages": ' + count + b"}") is None


MALFORMED = {
    "no value": line(checks=[{k: v for k, v in CHECK.items() if k != "value"}]),
    "no unit": line(checks=[{k: v for k, v in CHECK.items() if k != "unit"}]),
    "no limit": line(checks=[{k: v for k, v in CHECK.items() if k != "limit"}]),
    "unknown key": line(checks=[{**CHECK, "more": 1}]),
    "infinite": line(checks=[{**CHECK, "value": float("inf")}]),
    "huge": line(checks=[{**CHECK, "value": int("1" * 400)}]),
    "surrogate": line(reason="\ud800"),
    "empty reason": line(reason=""),
    "long reason": line(reason="x" * 5000),
    "outcome": line(outcome="maybe"),
    "deep": b'{"dodo": "verdict", "checks": ' + b"[" * 30_000,
    "limit": line(checks=[{**CHECK, "limit": {"most": 1}}]),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_other_verdicts_are_malformed(case: str) -> None:
    assert isinstance(read_line("judge", True, MALFORMED[case]), Malformed)


@given(st.binary(max_size=200) | st.text(max_size=100).map(lambda t: ('{"dodo": ' + t).encode("utf-8", "replace")))
def test_any_line_is_read(raw: bytes) -> None:
    read_line("judge", True, raw)
