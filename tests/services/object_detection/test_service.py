from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context, Flags
from services.base.flags import load_manifest, parse
from services.object_detection.service import ANNOUNCEMENT, LOGIC, ObjectDetection
from tests.services.built import hand, refusal
from tests.services.object_detection.test_truth import single, write
from tests.services.process import ROOT

YELLOW, BLUE = ("color:yellow", (0.1, 0.1, 0.05, 0.05)), ("blue", (-0.015, 0.0, 0.031, 0.042))
START = 1_700_000_000_000_000
LIMITS = ("--min-recall=0.9", "--min-precision=0.9", "--min-frames=2")


@pytest.fixture
def truth(tmp_path: Path) -> Path:
    return write(tmp_path, single())


def flags(*words: str) -> Flags:
    return parse(load_manifest(ROOT / "services" / "object_detection"), ["--cid=128", *words])


def service(*words: str) -> ObjectDetection:
    return ObjectDetection(Context("object-detection", flags(*words), MessageSet.standard()))


def test_it_hears_what_its_flags_name(truth: Path) -> None:
    kinds = {LOGIC + name for name in ("BoundingBox", "Property", "Type")}
    judge = service(f"--truth={truth}", "--sender=3", "--frame-sender=3", *LIMITS)
    assert set(judge.inputs) == {(name, 3) for name in kinds} | {(ANNOUNCEMENT, 3)}
    assert judge.period is not None
    judge = service("--truth-sender=9", *LIMITS)
    assert set(judge.inputs) == {(name, sender) for name in kinds for sender in (0, 9)}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (LIMITS, "give one or more of --truth, --truth-sender"),
        ((*LIMITS, "--truth=TRUTH", "--truth-sender=9"), "give the true boxes either as a file"),
        ((*LIMITS, "--truth-sender=0"), "--truth-sender=0 is the --sender of the detections"),
        (
            (*LIMITS, "--truth=TRUTH", "--max-time=1"),
            "no frame would be judged: --max-time must be longer than --from",
        ),
        ((*LIMITS, "--truth=TRUTH", "--classes=yelow"), "has no box of class 'yelow'; did you mean 'yellow'?"),
        ((*LIMITS, "--truth=TRUTH", "--classes=x"), "has no box of class 'x'; it has blue, yellow"),
    ],
)
def test_flags_that_leave_something_open_are_refused(truth: Path, words: tuple[str, ...], said: str) -> None:
    with pytest.raises(ValueError) as raised:
        service(*(word.replace("TRUTH", str(truth)) for word in words))
    assert said in str(raised.value)


def take(judge: ObjectDetection, sample_time: int, *boxes: Any, sender: int = 0) -> None:
    """As `send_detections`, without a bus."""
    for detection, (label, (x, y, width, height)) in enumerate(boxes):
        key = {"detectionId": detection}
        hand(judge, LOGIC + "Property", sample_time, sender, property=label, **key)
        hand(judge, LOGIC + "BoundingBox", sample_time, sender, x=x, y=y, width=width, height=height, **key)


def test_a_live_truth() -> None:
    judge = service("--truth-sender=9", "--frame-sender=9", *LIMITS)
    judge.begin(START)
    for frame in range(3):
        take(judge, frame, YELLOW, BLUE, sender=9)
        take(judge, frame, BLUE)
    hand(judge, ANNOUNCEMENT, 7, 9)
    take(judge, 7, YELLOW)
    judge.end_of_input(START + 1_000_000)
    assert judge.verdict is None, "answers may follow for a second"
    judge.update(START + 2_000_000)
    assert judge.verdict is not None and judge.verdict.outcome == "failed"
    checks = {check.name: check.value for check in judge.verdict.checks}
    assert [checks[name] for name in ("true-positives", "false-positives", "false-negatives", "frames")] == [3, 1, 3, 4]


def test_a_truth_that_cannot_be_used_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, "{}")
    assert refusal("object_detection", f"--truth={path}", *LIMITS) == f"{path}: $: 'images' is missing"
