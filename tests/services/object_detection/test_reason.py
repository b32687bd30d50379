import pytest

from dodo_dsl.run.protocol import VerdictEvent
from dodo_dsl.run.service_protocol import read
from services.object_detection.boxes import Box, Detections, LabelledBox
from services.object_detection.model import verdict
from services.object_detection.score import Counts, CountsByClass, Score, compare
from tests.services.object_detection.test_model import flags


def score(hits: int, false: int, missed: int, **about: int) -> Score:
    frames = {"frames": 2, "answered": 2, **about}
    return Score(CountsByClass({"yellow": Counts(hits, false, missed)}), **frames)  # type: ignore[arg-type]


def test_a_measure_without_a_value_says_why() -> None:
    reason = verdict(score(0, 0, 0), flags(min_precision=0.1, min_recall=0.1), "").reason
    assert reason == (
        "precision has no value (at least 0.1), because nothing was detected; "
        "recall has no value (at least 0.1), because there was nothing to detect"
    )


ALL = flags(min_precision=0.9, min_recall=0.9, min_f1=0.9, each_class=True)


def by_class(**counts: Counts) -> Score:
    return Score(CountsByClass(counts), frames=2, answered=2)


def test_what_all_classes_do_alike_is_told_once() -> None:
    """The classes, and F1, say no more then; the checks still have them."""
    failed = verdict(by_class(yellow=Counts(0, 2, 2), blue=Counts(0, 1, 1)), ALL, "")
    assert failed.reason == (
        "precision is 0 (at least 0.9), with 3 false detections beside 0 found; "
        "recall is 0 (at least 0.9), with 3 missed beside 0 found"
    )
    assert sum(not check.ok for check in failed.checks) == 9


def test_a_class_that_is_worse_than_another_is_named() -> None:
    reason = verdict(by_class(yellow=Counts(0, 0, 3), blue=Counts(3, 0, 0)), ALL, "").reason
    assert reason == (
        "recall is 0.5 (at least 0.9), with 3 missed beside 3 found; "
        "precision of yellow has no value (at least 0.9), because nothing was detected; "
        "recall of yellow is 0 (at least 0.9), with 3 missed beside 0 found"
    )


def test_f1_alone_is_told() -> None:
    reason = verdict(score(8, 1, 1), flags(min_precision=0.8, min_recall=0.8, min_f1=0.9), "").reason
    assert reason == "F1 is 0.8889 (at least 0.9), with 1 false detection and 1 missed beside 8 found"


def test_labels_of_an_application_cannot_make_a_verdict_that_is_not_read() -> None:
    """A class of any length, and more classes than a reason or a line may name."""
    made_up = {}
    for number in range(1000):
        detections = Detections()
        detections.add(0, f"{number} " + "\N{ROBOT FACE}" * 3000)
        detections.add(0, Box(0, 0, 1, 1))
        made_up[detections.labelled()[0].label] = Counts(0, 1, 0)
    failed = verdict(by_class(**made_up, yellow=Counts(1, 0, 0)), ALL, "")
    line = failed.line().encode()
    event = read("judge", True, line)
    assert len(line) < 1 << 16
    assert isinstance(event, VerdictEvent) and not event.passed
    assert "recall-yellow" in {check.name for check in failed.checks}
    assert event.reason.startswith("precision is 0.") and event.reason.endswith("…")


@pytest.mark.parametrize(
    ("found", "kind"),
    [
        (LabelledBox("b", Box(0.1, 0.5, 0.04, 0.05)), "misnamed"),
        (LabelledBox("a", Box(0.1, 0.5, 0.04, 0.05)), "doubled"),
        (LabelledBox("a", Box(0.12, 0.5, 0.04, 0.05)), "loose"),
        (LabelledBox("a", Box(0.3, 0.5, 0.04, 0.05)), "nowhere"),
        (LabelledBox("a", Box(64, 240, 26, 24)), "far"),
    ],
)
def test_kinds_of_false_detections(found: LabelledBox, kind: str) -> None:
    true = LabelledBox("a", Box(0.1, 0.5, 0.04, 0.05))
    assert compare([true, found], [true], 0.5, ()).kinds == {kind: 1}


def test_small_objects_are_missed() -> None:
    found = Score(CountsByClass({"a": Counts(1, 0, 1)}, missed=[0.05], found=[0.1]), frames=2, answered=2)
    assert "; missed objects are small: 0.05 of the picture's height on average, and found ones 0.1" in (
        verdict(found, flags(), "").reason
    )
