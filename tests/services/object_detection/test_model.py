import json
from typing import Any

import pytest

from services.base import Flags, UnjudgeableError, Verdict
from services.object_detection.boxes import Box, FrameKey, LabelledBox, Truth
from services.object_detection.model import DetectionEvaluator
from tests.services.built import hide

SECOND = 1_000_000
BEGIN = 7_000 * SECOND
A, B, FAR = Box(0.1, 0.1, 0.1, 0.1), Box(0.5, 0.1, 0.1, 0.1), Box(0.8, 0.8, 0.1, 0.1)
YELLOW, BLUE = LabelledBox("yellow", A), LabelledBox("blue", B)
BOARD = Truth("one", {0: (YELLOW, BLUE)})
FILM = Truth("sample-time", {number * SECOND: (YELLOW, BLUE) for number in range(1, 6)})


def flags(**given: Any) -> Flags:
    """Those given, and few limits."""
    usual = {"iou": 0.5, "classes": [], "max-delay": 1.0, "max-time": 60.0, "from": 0.0, "start-up": 0.0,
             "min-precision": None, "min-recall": 0.9, "min-f1": None, "min-frames": 1, "each-class": False,
             "max-unanswered": None, "max-gap": None}  # fmt: skip
    return Flags({**usual, **{name.replace("_", "-"): value for name, value in given.items()}})


def judge(truth: Truth | None = BOARD, **given: Any) -> DetectionEvaluator:
    """A judge whose test has begun."""
    it = DetectionEvaluator(truth, flags(**given))
    it.update(BEGIN - SECOND)
    it.begin(BEGIN)
    return it


def detect(it: DetectionEvaluator, frame: float, *boxes: LabelledBox) -> None:
    """All detections of the frame whose sample time is so many seconds."""
    key = FrameKey(round(frame * SECOND), round(frame))
    for number, (label, box) in enumerate(boxes):
        it.detect(key, number, label)
        it.detect(key, number, box)


def reveal(it: DetectionEvaluator, frame: float, *boxes: LabelledBox) -> None:
    key = FrameKey(round(frame * SECOND), round(frame))
    for number, (label, box) in enumerate(boxes):
        it.reveal(key, number, box)
        it.reveal(key, number, label)


def at(it: DetectionEvaluator, seconds: float) -> None:
    it.update(BEGIN + round(seconds * SECOND))


def decided(it: DetectionEvaluator, seconds: float = 10.0, after: float = 1.0) -> Verdict:
    """The verdict when the input has ended after so many seconds, some time ``after`` that."""
    it.end_of_input(BEGIN + round(seconds * SECOND))
    at(it, seconds + after)
    assert it.verdict is not None
    return it.verdict


def values(verdict: Verdict) -> dict[str, float | None]:
    return {check.name: check.value for check in verdict.checks}


def test_what_is_found_passes() -> None:
    it = judge(min_precision=0.7, min_recall=0.7, min_f1=0.7, min_frames=2)
    detect(it, 1, YELLOW, BLUE)
    at(it, 0.5)
    detect(it, 2, BLUE, LabelledBox("red", FAR))
    verdict = decided(it)
    assert (verdict.outcome, verdict.reason) == (
        "passed",
        "found 3 of 4 objects in 2 frames, with 1 false detection: precision 0.75 (at least 0.7), "
        "recall 0.75 (at least 0.7), f1 0.75 (at least 0.7)",
    )
    assert values(verdict) == {
        "precision": 0.75, "recall": 0.75, "f1": 0.75, "true-positives": 3, "false-positives": 1, "false-negatives": 1,
        "mean-iou": pytest.approx(1.0), "frames": 2, "answered": 2, "unanswered": 0.0, "gap": 9.5,
        "without-truth": 0, "late": 0, "repeated": 0,
        "precision-yellow": 1.0, "recall-yellow": 0.5, "f1-yellow": 2 / 3,
        "precision-blue": 1.0, "recall-blue": 1.0, "f1-blue": 1.0,
        "precision-red": 0.0, "recall-red": None, "f1-red": 0.0,
    }  # fmt: skip
    assert all(check.ok for check in verdict.checks)


def test_every_limit_that_is_broken_is_named_with_the_worst_frame() -> None:
    it = judge(min_precision=0.9, min_recall=0.9, min_f1=0.9, min_frames=3)
    detect(it, 1, YELLOW, BLUE)
    at(it, 0.5)
    detect(it, 2, LabelledBox("yellow", FAR))
    assert (decided(it).outcome, decided(it).reason) == (
        "failed",
        "precision is 0.6667 (at least 0.9), with 1 false detection beside 2 found; "
        "recall is 0.5 (at least 0.9), with 2 missed beside 2 found; "
        "only 2 frames had an answer (at least 3); "
        "false detections: 1 where nothing is; worst was the frame at 0.50 s, with 1 false and 2 missed",
    )


def test_nothing_to_find_is_the_fault_of_the_test() -> None:
    it = judge(truth=None, min_precision=0.0, min_recall=0.0, min_f1=0.0, classes=["yellow", "blue"])
    reveal(it, 2, YELLOW)
    detect(it, 2, YELLOW)
    with pytest.raises(UnjudgeableError, match=r"^no true box of class 'blue' came before the input ended after 10.00"):
        decided(it)
    it = judge(truth=Truth("number", {1: (), 2: (YELLOW,)}), classes=["blue"])
    detect(it, 1, YELLOW)
    with pytest.raises(UnjudgeableError, match=r"^none of 2 frames has a true box before the input ended"):
        decided(it)


def live(silent: range, frames: int = 30, **given: float) -> Verdict:
    """The verdict when an application answers all frames, of 10 Hz, but some."""
    it = judge(truth=None, **{"min_recall": 0.5, "max_unanswered": 0.1, "max_gap": 1.0, **given})
    for number in range(frames):
        at(it, number / 10)
        reveal(it, number / 10, YELLOW)
        if number not in silent:
            detect(it, number / 10, YELLOW)
    return decided(it, frames / 10)


def test_frames_without_an_answer_are_named_by_their_longest_run() -> None:
    assert live(range(5, 8)).outcome == "passed"
    verdict = live(range(5, 9))
    assert (verdict.outcome, values(verdict)["unanswered"]) == ("failed", 4 / 30)
    assert verdict.reason.startswith(
        "4 of 30 frames had no answer, a share of 0.1333 (at most 0.1), the longest run is 4 frames, "
        "from 0.50 s to 0.80 s; worst was the frame at "
    )


@pytest.mark.parametrize(("first", "outcome"), [(15, "passed"), (16, "failed")])
def test_the_application_may_start_slowly(first: int, outcome: str) -> None:
    verdict = live(range(first), start_up=1.5, min_recall=0.1)
    assert verdict.outcome == outcome
    assert values(verdict)["answered"] == 30 - first, "recall counts them all the same"


def test_a_frame_that_was_announced_counts_without_a_detection() -> None:
    for by_application in (True, False):
        it = judge()
        detect(it, 1, YELLOW, BLUE)
        it.announce(FrameKey(2 * SECOND, 2), by_application)
        found = values(decided(it))
        assert (found["frames"], found["false-negatives"], found["answered"]) == (2, 2, 1 + by_application)


def test_a_frame_of_a_live_truth_counts_without_a_detection_and_one_without_truth_does_not() -> None:
    it = judge(truth=None)
    reveal(it, 1, YELLOW, BLUE)
    reveal(it, 2, YELLOW, BLUE)
    detect(it, 2, YELLOW)
    detect(it, 3, YELLOW, BLUE, BLUE)
    found = values(decided(it))
    assert (found["frames"], found["true-positives"], found["false-negatives"]) == (2, 1, 3)
    assert (found["without-truth"], found["false-positives"]) == (1, 0)
    assert decided(it).reason.endswith("; left out: 1 frame without ground truth")


def test_sample_times_that_never_meet_are_said() -> None:
    it = judge(truth=None)
    reveal(it, 1, YELLOW)
    detect(it, 1.01, YELLOW)
    detect(it, 2.01, YELLOW)
    assert decided(it).reason == (
        "none of 2 frames with detections has ground truth: is their sample time that of the picture?"
    )


def test_pictures_of_a_film_that_were_not_answered_are_missed() -> None:
    it = judge(FILM)
    detect(it, 2, YELLOW, BLUE)
    detect(it, 4, YELLOW, BLUE)
    detect(it, 4.5, YELLOW)
    found = values(decided(it))
    assert (found["frames"], found["answered"], found["false-negatives"], found["without-truth"]) == (5, 2, 6, 1)


def test_pictures_behind_the_last_answer_do_not_count_when_the_time_is_over() -> None:
    it = judge(FILM)
    detect(it, 2, YELLOW, BLUE)
    detect(it, 4, YELLOW, BLUE)
    at(it, 60)
    assert it.verdict is None
    at(it, 60.01)
    assert it.verdict is not None and values(it.verdict)["frames"] == 4


def test_detections_that_come_late_do_not_count() -> None:
    it = judge()
    detect(it, 1, YELLOW)
    at(it, 0.99)
    detect(it, 1, YELLOW, BLUE)
    at(it, 1.0)
    it.detect(FrameKey(SECOND, 1), 7, BLUE.box)
    found = values(decided(it))
    assert (found["true-positives"], found["false-positives"], found["late"], found["repeated"]) == (2, 0, 1, 1)
    assert decided(it).reason.endswith(
        "; left out: 1 detection too late, 1 detection under a detectionId that was in use"
    )


def test_the_begin_forgets_what_was_before() -> None:
    it = DetectionEvaluator(FILM, flags(min_recall=1.0))
    it.update(BEGIN - 9 * SECOND)
    detect(it, 1)
    detect(it, 2, YELLOW)
    it.update(BEGIN - 5 * SECOND)
    detect(it, 3, YELLOW)
    it.begin(BEGIN)
    it.begin(BEGIN + SECOND)
    for frame in (2, 3, 4):
        detect(it, frame, YELLOW, BLUE)
    found = values(decided(it))
    assert (found["true-positives"], found["late"]) == (2, 0)
    assert found["frames"] == 3  # 1 and 5 were never spoken of


def test_pictures_of_the_future_cannot_be_answered() -> None:
    """Else a hard one could be used up before it is shown."""
    it = judge(truth=None)
    it.arrived = BEGIN
    detect(it, 7_003, LabelledBox("yellow", FAR))
    at(it, 3.0)
    it.arrived = BEGIN + 3 * SECOND
    reveal(it, 7_003, YELLOW)
    detect(it, 7_003, YELLOW)
    verdict = decided(it)
    assert values(verdict)["recall"] == 1.0
    assert "left out: 1 detection of the future" in verdict.reason


def frames(it: DetectionEvaluator) -> list[tuple[int, bool, list[list[object]]]]:
    it.record()
    lines = [json.loads(line) for line in it.judged.lines({})]
    return [tuple(row) for line in lines for row in line.get("frames", ())]


def test_what_became_of_each_box_is_recorded() -> None:
    it = judge(min_precision=0.7, min_recall=0.7, min_f1=0.7, min_frames=2, classes=["yellow", "blue"])
    near = LabelledBox("blue", Box(0.5, 0.1, 0.1, 0.08))
    detect(it, 1, near, LabelledBox("red", FAR), LabelledBox("blue", FAR))
    decided(it)
    hit, false, missed = ["hit", "blue", *near.box, 0.8], ["false", "blue", *FAR], ["missed", "yellow", *A]
    assert frames(it) == [(SECOND, True, [hit, false, missed])]


def test_pictures_that_were_not_shown_are_neither_missed_nor_a_gap() -> None:
    """Of five pictures of a film, one a second, the third and the fourth were not shown."""
    for is_told, outcome in ((True, "passed"), (False, "failed")):
        it = judge(FILM, min_recall=1.0, max_unanswered=0.0, max_gap=1.5)
        for frame in (1, 2, 5):
            at(it, frame)
            detect(it, frame, YELLOW, BLUE)
        for frame in (3, 4) if is_told else ():
            begin, end = (BEGIN + each * SECOND for each in (frame, frame + 1))
            hide(it, begin, end, sampled=frame * SECOND, sampled_until=(frame + 1) * SECOND)
        verdict = decided(it, 5.5)
        assert verdict.outcome == outcome, verdict.reason
        assert values(verdict)["gap"] == (1.0 if is_told else 3.0)


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.2])
def test_in_lockstep_a_frame_waits_from_its_own_time_for_its_answer(delay: float) -> None:
    """The truth comes with the step that ends at the frame's time, the answer with the next one."""
    it = judge(None, max_delay=delay)
    for step in range(1, 21):
        if step > 1:
            detect(it, 7_000 + (step - 1) / 10, YELLOW)
        reveal(it, 7_000 + step / 10, YELLOW)
        for part in (-0.05, 0.0):
            at(it, step / 10 + part)
    verdict = decided(it, 2.0)
    assert (values(verdict)["true-positives"], values(verdict)["late"]) == (19, 0)
