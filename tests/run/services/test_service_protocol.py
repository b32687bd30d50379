"""What services tell the runner is taken only when it is well-formed and a report can show it."""

import asyncio
import json
import socket
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.opendlv.packets import RUNNER_SOCKET, Connection
from dodo_dsl.outcome import Response
from dodo_dsl.run.protocol import (
    Event,
    Finding,
    Foreign,
    InputEnded,
    Late,
    Noted,
    Overrun,
    Paused,
    Ready,
    Responded,
    Started,
    Stopped,
    Time,
    VerdictEvent,
)
from dodo_dsl.run.service_protocol import Reports, read
from tests.run.scripted import plan

CHECK = {"name": "time", "value": 1.5, "limit": {"max": 2}, "unit": "s", "ok": True}
JUDGED = {**CHECK, "margin": 0.5, "margin_share": 0.2}


def line(**changes: object) -> bytes:
    return json.dumps({"dodo": "verdict", "outcome": "passed", "reason": "done", "checks": [CHECK], **changes}).encode()


def test_a_complete_verdict_is_taken_from_an_evaluator() -> None:
    assert read("track", True, line()) == VerdictEvent("track", True, "done", (JUDGED,))
    assert read("track", True, line(outcome="failed")) == VerdictEvent("track", False, "done", (JUDGED,))
    assert read("track", False, line()) is None


LATE = {"dodo": "late", "updates": 12, "late": 3, "worst_s": 0.25}
SAID = {
    '{"dodo": "ready"}': Ready("camera"),
    '{"dodo": "lost", "messages": 12}': Overrun("camera", 12),
    '{"dodo": "foreign", "reason": "so"}': Foreign("so"),
    json.dumps(LATE): Late("camera", 12, 3, 0.25),
    '{"dodo": "paused", "seconds": 0.061}': Paused("camera", 0.061),
    '{"dodo": "end-of-input"}': InputEnded("camera"),
    '{"dodo": "note", "text": "so"}': Noted("service 'camera': so"),
}
WRONG = {
    '{{"dodo": "lost", "messages": {}}}': ("0", "-1", "true", "1.5", '"12"', "null", "1" * 30),
    '{{"dodo": "foreign", "reason": {}}}': ('""',),
    '{{"dodo": "paused", "seconds": {}}}': ("0", "-1", '"1"', "null", "true", "NaN", "[]"),
    '{{"dodo": "note", "text": {}}}': ('""', "3", "null", f'"{"x" * 3000}"', '"\\ud800"'),
}


def test_these_are_taken_from_every_service() -> None:
    for text, event in SAID.items():
        assert read("camera", False, f"{text}\n".encode()) == event
    for form, values in WRONG.items():
        assert [read("camera", True, form.format(value).encode()) for value in values] == [None] * len(values)
    for change in ({"late": 13}, {"late": 0}, {"updates": "12"}, {"worst_s": -1}, {"worst_s": None}, {"late": 1.5}):
        assert read("camera", False, json.dumps({**LATE, **change}).encode()) is None


def test_a_verdict_may_carry_the_data_of_its_decision() -> None:
    evidence = {"time": 5.2, "obstacle": "left", "x": None, "sample-time": 1_700_000_005_200_000}
    event = read("track", True, line(evidence=evidence))
    assert event == VerdictEvent("track", True, "done", (JUDGED,), evidence)
    assert isinstance(event, VerdictEvent)
    assert event.as_json() == {"evaluator": "track", "outcome": "passed", "reason": "done", "evidence": evidence}


def checked(**changes: object) -> bytes:
    return line(checks=[{**CHECK, **changes}])


MALFORMED = {
    "evidence list": line(evidence=[1]),
    "much evidence": line(evidence={f"a{n}": n for n in range(21)}),
    "evidence key": line(evidence={"No": 1}),
    "evidence object": line(evidence={"x": {}}),
    "infinite evidence": line(evidence={"x": float("inf")}),
    "long evidence": line(evidence={"x": "a" * 201}),
    **{f"no {key}": line(checks=[{k: v for k, v in CHECK.items() if k != key}]) for key in CHECK},
    "unknown key": checked(more=1),
    "infinite": checked(value=float("inf")),
    "ok": checked(ok=1),
    "limit": checked(limit={"most": 1}),
    "surrogate": line(reason="\ud800"),
    "empty reason": line(reason=""),
    "outcome": line(outcome="maybe"),
    "deep": b'{"dodo": "verdict", "checks": ' + b"[" * 30_000,
    "unfinished": line()[:-5],
}


@pytest.mark.parametrize("case", MALFORMED)
def test_other_verdicts_are_malformed(case: str) -> None:
    found = read("track", True, MALFORMED[case])
    assert isinstance(found, Finding) and 0 < len(found.reason) < 250
    assert ("its outcome is neither passed nor failed" in found.reason) == (case == "outcome")
    assert read("camera", False, MALFORMED[case]) is None


RESPONSE = {
    "answers": 3, "period_s": 0.1, "median_s": 0.01, "p95_s": 0.02, "worst_s": 0.03, "slow": 0, "over": 1,
    "processor": "", "uncopied": 2,
}  # fmt: skip


def response(**changes: object) -> str:
    return json.dumps({"dodo": "response", "response": {**RESPONSE, **changes}})


CLOCKED = {
    response(): Responded(Response(**RESPONSE)),  # type: ignore[arg-type]
    response(answers=0): None,
    response(p95_s="0.1"): None,
    '{"dodo": "time", "seconds": 1.5}': Time(1.5, False),
    '{"dodo": "started"}': Started(),
    '{"dodo": "time", "seconds": 2, "last": true}': Time(2.0, True),
    '{"dodo": "time"}': None,
    '{"dodo": "stopped", "how": "stuck", "reason": "x"}': Stopped("stuck", "x"),
    '{"dodo": "stopped", "how": "unanswered", "reason": "", "silent": true}': Stopped("unanswered", "", True),
    '{"dodo": "stopped", "how": "gone", "reason": "x"}': None,
    '{"dodo": ["stopped"], "how": "stuck", "reason": "x"}': None,
}


@pytest.mark.parametrize("text", CLOCKED)
def test_what_the_clock_says(text: str) -> None:
    assert read("dodo-clock", False, text.encode()) == CLOCKED[text]


@pytest.mark.parametrize(
    "text", [b"", b"ready", b"{}", b'{"dodo": 3}', b'["dodo"]', b'  {"ready": "dodo"}', b'{"dodo"']
)
def test_other_lines_are_log(text: bytes) -> None:
    assert read("track", True, text) is None


NOTE = b'{"dodo": "note", "text": "so"}'
VERDICT = b'{"dodo": "verdict", "outcome": "passed", "reason": "so", "checks": []}'


def test_what_was_said_counts_and_nobody_waits(tmp_path: Path) -> None:
    """Of those, too, who end at once, whose name comes late, or whose message comes in parts."""
    one, events, path = plan(), list[Event](), tmp_path / RUNNER_SOCKET
    (judge, *_) = (service for service in one.services if service.judge)
    brief = [replace(judge, name=f"brief{n}", judge=False) for n in range(4)]

    async def scene() -> None:
        reports = Reports(replace(one, services=(judge, *brief)), tmp_path, events.append, {})
        reports.listen(tmp_path)
        for service in brief:
            with closing(Connection.open(path, service.name)) as connection:
                connection.send(NOTE)
        await reports.ended(brief[-1].name)
        assert events == [Noted(f"service '{service.name}': so") for service in brief]
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as late:
            late.connect(str(path))
            await asyncio.sleep(0.01)
            for packet in (b"\0" + judge.name.encode(), b"\1" + VERDICT[:9], b"\0" + VERDICT[9:]):
                late.send(packet)
                await asyncio.sleep(0.01)
            assert not reports.take_line(judge.name, VERDICT), "it has connected"
        await reports.ended(judge.name)
        assert events[4:] == [VerdictEvent(judge.name, True, "so", ())] and not path.exists()
        reports.close()

    asyncio.run(scene())
