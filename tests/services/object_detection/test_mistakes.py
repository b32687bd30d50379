"""What a verdict says of applications that are wrong in one way."""

from collections.abc import Callable

import pytest

from services.object_detection.boxes import Box, LabelledBox
from services.object_detection.score import CountsByClass, compare

TRUE = [LabelledBox(label, Box(0.1 + 0.2 * n, 0.5, 0.04, 0.05 + 0.03 * n)) for n, label in enumerate(("a", "a", "b"))]


def wrong(change: Callable[[LabelledBox], list[LabelledBox]]) -> str:
    """The sentence on two frames in which everything is found as ``change`` has it."""
    both = CountsByClass()
    for _ in range(2):
        both.mistakes.add(compare([new for each in TRUE for new in change(each)], TRUE, 0.5, ()).mistakes)
    return both.mistakes.sentence


def moved(right: float, times: float = 1.0) -> Callable[[LabelledBox], list[LabelledBox]]:
    return lambda each: [each._replace(box=Box(*(times * v for v in each.box))._replace(x=times * each.box.x + right))]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda each: [each], ""),
        (lambda each: [each._replace(label="b" if each.label == "a" else "a")], "6 on objects of another class"),
        (lambda each: [each, each], "6 on objects that others found"),
        (moved(0.02), "6 beside objects or around them"),
        (moved(0.1), "6 where nothing is"),
        (moved(0.0, 640), "6 far outside the picture (are they in pixels?)"),
    ],
)
def test_false_detections_are_told_apart(change: Callable[[LabelledBox], list[LabelledBox]], sentence: str) -> None:
    assert wrong(change) == (sentence and f"false detections: {sentence}")


def test_small_objects_alone_are_missed() -> None:
    sentence = wrong(lambda each: [each] if each.box.height > 0.1 else [])
    assert sentence == "missed objects are small: 0.065 of the picture's height on average, and found ones 0.11"
    assert wrong(lambda each: [each] if each.box.height < 0.1 else []) == ""
