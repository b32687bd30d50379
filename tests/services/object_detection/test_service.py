import json
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from services.base import Context, Flags
from services.base.flags import load_manifest, parse, parser
from services.object_detection.service import ANNOUNCEMENT, LOGIC, ObjectDetection
from tests.services.built import hand, refusal
from tests.services.object_detection.test_truth import single, write
from tests.services.process import PATIENCE, ROOT, running, send

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


def send_detections(session: Session, sample_time: int, *boxes: Any, sender: int = 0, number: int = 0) -> None:
    """The detections of a frame, as applications send them."""
    for detection, (label, (x, y, width, height)) in enumerate(boxes):
        key: dict[str, Any] = {
            "sender_stamp": sender, "sample_time": sample_time, "sampleId": number, "detectionId": detection
        }  # fmt: skip
        send(session, LOGIC + "Type", type=1, **key)
        send(session, LOGIC + "Property", property=label, **key)
        send(session, LOGIC + "BoundingBox", x=x, y=y, width=width, height=height, **key)


def finished(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    output, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, output, errors


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
        (LIMITS, "give the true boxes either as a file, --truth, or as messages, --truth-sender"),
        ((*LIMITS, "--truth=TRUTH", "--truth-sender=9"), "give the true boxes either as a file"),
        ((*LIMITS, "--truth-sender=0"), "--truth-sender=0 is the --sender of the detections"),
        (
            ("--truth=TRUTH",),
            "no limit: give one or more of --min-precision, --min-recall, --min-f1",
        ),
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


@pytest.mark.slow
def test_the_verdict_on_the_bus(truth: Path, cid: int, tmp_path: Path) -> None:
    words = (f"--cid={cid}", f"--truth={truth}", "--max-delay=4", *LIMITS)
    with Session(cid) as session, running("object_detection", tmp_path, *words) as process:
        now = time.time_ns() // 1000 - 100_000  # however long the start took
        send(session, "dodo.TestBegin", sample_time=now)
        for frame in range(20):
            time_us = now + frame * 4_000  # none is of the future, however quickly they come
            send_detections(session, time_us, YELLOW, BLUE, number=frame)
            send_detections(session, time_us, ("red", (0, 0, 1, 1)), sender=4)
        send(session, "dodo.EndOfInput", source="recording")
        code, output, errors = finished(process)
    assert (code, errors) == (0, "")
    verdict = json.loads(output.splitlines()[-1])
    assert (verdict["outcome"], verdict["reason"]) == (
        "passed",
        "found 40 of 40 objects in 20 frames, with 0 false detections: "
        "precision 1 (at least 0.9), recall 1 (at least 0.9)",
    )
    assert verdict["checks"][1] == {"name": "recall", "value": 1.0, "limit": {"min": 0.9}, "unit": "", "ok": True}


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


def test_a_silent_application_fails_when_the_time_is_over(truth: Path) -> None:
    judge = service(f"--truth={truth}", "--max-delay=0.01", "--max-time=0.05", *LIMITS)
    judge.begin(START)
    judge.update(START + 60_000)
    assert judge.verdict is not None and judge.verdict.reason == "no detection came within 0.05 s"


def test_a_truth_that_cannot_be_used_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, "{}")
    assert refusal("object_detection", f"--truth={path}", *LIMITS) == f"{path}: $: 'images' is missing"


def test_help_names_the_equations() -> None:
    assert "(equation 4.3)" in parser(load_manifest(ROOT / "services" / "object_detection")).format_help()
