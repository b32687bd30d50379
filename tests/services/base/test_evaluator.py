import json

import pytest

from services.base import JudgedBoxes, Verdict
from services.base.evaluator import Evaluator, JudgedTime

SECOND = 1_000_000
BEGIN = 7_000 * SECOND


class Spans(Evaluator):
    """Passes, and keeps the spans on which it had to decide."""

    def __init__(self, max_time: float = 10.0, max_delay: float = 0.0) -> None:
        super().__init__(max_time, max_delay)
        self.spans: list[JudgedTime] = []
        self.begun: list[int] = []
        self.advanced: list[int] = []

    def forget(self, now: int) -> None:
        self.begun.append(now)

    def advance(self, now: int) -> None:
        self.advanced.append(now)

    def decide(self, span: JudgedTime) -> Verdict:
        self.spans.append(span)
        return Verdict("passed", span.within)


def test_the_time_of_a_test_is_limited() -> None:
    evaluator = Spans()
    evaluator.begin(BEGIN)
    evaluator.update(BEGIN + 10 * SECOND)
    assert evaluator.verdict is None
    evaluator.update(BEGIN + 10 * SECOND + 1)
    assert evaluator.verdict == Verdict("passed", "within 10.00 s")
    assert evaluator.spans == [JudgedTime("within 10.00 s", "for 10.00 s", False)]


def test_what_was_judged_before_the_begin_does_not_count() -> None:
    evaluator = Spans()
    series = evaluator.judged.series("x", high=1)
    series.add(BEGIN - SECOND, 7.0, target=0.5)
    evaluator.judged.frame(BEGIN - SECOND, JudgedBoxes((), (), ()))
    evaluator.begin(BEGIN)
    assert [json.loads(line) for line in evaluator.judged.lines({})] == [{"dodo": "judged", **next(series.lines())}]
    series.add(BEGIN, 1.0)
    samples = json.loads([*evaluator.judged.lines({})][1])
    assert (samples["zero"], samples["marks"]) == (BEGIN, "AA==")


def test_the_end_of_the_input_is_the_end() -> None:
    evaluator = Spans()
    evaluator.begin(BEGIN)
    evaluator.end_of_input(BEGIN + 12_340_000)
    over = "the input ended after 12.34 s"
    assert evaluator.spans == [JudgedTime(f"before {over}", f"until {over}", True)]


def test_answers_may_follow_the_input() -> None:
    evaluator = Spans(max_time=6, max_delay=2)
    evaluator.begin(BEGIN)
    evaluator.end_of_input(BEGIN + 5 * SECOND)
    evaluator.end_of_input(BEGIN + 6 * SECOND)
    evaluator.update(BEGIN + 7 * SECOND - 1)
    assert evaluator.verdict is None
    evaluator.update(BEGIN + 7 * SECOND)
    assert evaluator.spans == [
        JudgedTime("before the input ended after 5.00 s", "until the input ended after 5.00 s", True)
    ]


@pytest.mark.parametrize("early", [[], [BEGIN - 9 * SECOND]])
def test_the_first_begin_is_time_zero_whatever_came_before(early: list[int]) -> None:
    evaluator = Spans()
    for now in early:
        evaluator.update(now)
    evaluator.begin(BEGIN)
    evaluator.begin(BEGIN + 5 * SECOND)
    assert (evaluator.begun, evaluator.elapsed(BEGIN + SECOND), evaluator.zero) == ([BEGIN], 1.0, BEGIN)
