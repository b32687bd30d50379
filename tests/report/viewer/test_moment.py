"""Which moment decided a test."""

from dataclasses import replace
from typing import Any

import pytest

from dodo_dsl.outcome import Outcome
from dodo_dsl.report.viewer.moment import decisive

OUTCOME = replace(
    Outcome(
        "t", "t", "t.dodo.yml", "sil", "open-loop", "failed", "bad; it is told its pose", 130, 0, "lockstep", "process"
    ),
    decided_by="signal",
)
EVIDENCE = {"time": 2.4, "value": 0.2, "target": 0.0, "gap-begin": 1.0, "gap-end": 1.6, "broken-time": 0.7}


def failed(*names: str) -> tuple[dict[str, Any], ...]:
    return tuple({"name": name, "value": 1, "limit": {}, "ok": False} for name in names)


@pytest.mark.parametrize(
    ("checks", "time"), [(("distance",), 2.4), (("gap",), 1.0), (("gap", "mean"), 2.4), (("broken", "gap"), 0.7)]
)
def test_evidence_by_what_failed(checks: tuple[str, ...], time: float) -> None:
    verdict = {"evaluator": "signal", "reason": "bad", "evidence": EVIDENCE}
    assert decisive(replace(OUTCOME, checks=failed(*checks), verdicts=(verdict,)), 5.5).time == time


@pytest.mark.parametrize("verdicts", [(), ({"evaluator": "other", "evidence": EVIDENCE},)])
def test_what_no_verdict_explains_ended_the_test(verdicts: tuple[dict[str, Any], ...]) -> None:
    moment = decisive(replace(OUTCOME, verdicts=verdicts), 5.5)
    assert (moment.time, moment.what) == (5.5, "the end of the test")


def test_a_hit_has_its_place() -> None:
    evidence = {"time": 3.2, "x": 1.0, "y": 2.0, "obstacle": "left"}
    moment = decisive(replace(OUTCOME, verdicts=({"evaluator": "signal", "evidence": evidence},)), 3.0)
    assert (moment.time, moment.what, moment.x, moment.y) == (3.2, "touched left", 1.0, 2.0)
