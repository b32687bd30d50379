"""Answers to frames, without a target: in time, finite, within bounds."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dodo_dsl.opendlv.envelope import Envelope
from services.base import JudgedTime, UnjudgeableError, Verdict
from services.rec_replay.selection import select
from services.responds.model import of_recording
from tests.services.built import MESSAGES, built, hand, hide, refusal
from tests.services.rec_replay.recordings import IMAGE, T0, message, write

STEERING, S = "opendlv.proxy.GroundSteeringRequest", 1_000_000
BEGIN = 1_700_000_000 * S
ANSWER = (f"--message={STEERING}", "--field=groundSteering", "--min=-0.5", "--max=0.5", "--min-frames=1")


@contextmanager
def judge(*flags: str) -> Iterator[Any]:
    with built("responds", *ANSWER, *flags) as it:
        it.begin(BEGIN)
        yield it


def answer(it: Any, sampled: int, arrival: float, value: float = 0.1) -> None:
    """An answer with a sample time in us, that arrives at a time in s of the test."""
    it.arrived = BEGIN + round(arrival * S)
    hand(it, STEERING, sampled, 0, groundSteering=value)


def decided(it: Any, seconds: float) -> Verdict:
    it.end_of_input(BEGIN + round(seconds * S))
    it.update(BEGIN + round((seconds + 1) * S))
    assert it.verdict is not None
    return it.verdict


def values(verdict: Verdict) -> dict[str, float | None]:
    return {check.name: check.value for check in verdict.checks}


def pictures(folder: Path, *times: float) -> Path:
    """A recording that begins with a message 1 s before its first picture at 0 s."""
    frames: list[Envelope] = [message(IMAGE, time, 2, data=b"x", format="h264") for time in times]
    return write(folder / "a.rec", [message("opendlv.proxy.PedalPositionRequest", -1), *frames])


@pytest.mark.parametrize("is_copied", [True, False])
def test_every_frame_of_a_recording_is_answered(tmp_path: Path, is_copied: bool) -> None:
    """By the sample times of its pictures, or else by when answers arrive."""
    times = [step / 10 for step in range(20)]
    with judge(f"--rec={pictures(tmp_path, *times)}", "--video-sender=2") as it:
        for step, time in enumerate(times):
            arrival = 1.05 + time
            answer(it, T0 + round(time * S) if is_copied else BEGIN + round(arrival * S), arrival, step / 40)
        verdict = decided(it, 3.4)
    assert (verdict.outcome, verdict.reason) == (
        "passed",
        f"answered 20 of 20 frames with {STEERING}/0, groundSteering from 0 to 0.475",
    )
    assert values(verdict) == {
        "share": 1.0, "frames": 20, "lowest": 0.0, "highest": pytest.approx(0.475), "broken": 0, "late": 0,
        "delay": pytest.approx(0.05),
    }  # fmt: skip


def test_frames_without_an_answer_in_time_are_told_with_the_longest_run() -> None:
    """Of 11 frames of 1 Hz, two have none, and one has its answer 1.5 s late, as the answer to another."""
    with judge("--freq=1", "--max-time=10.5", "--max-delay=0.9") as it:
        for step in (0, 1, 2, 5, 6, 7, 9, 10):
            answer(it, BEGIN + step * S, step + 0.1)
        answer(it, BEGIN + 8 * S, 9.5)
        verdict = decided(it, 10.4)
    assert verdict.reason == (
        "answered 8 of 11 frames in time, a share of 0.7273 (at least 0.95), the longest run is 2 frames, from 3.00 s "
        "to 4.00 s; 1 answer came later than 0.9 s after the frame, or before it"
    )
    assert (verdict.outcome, values(verdict)["late"]) == ("failed", 1)


def test_values_beyond_bounds_and_none_at_all_fail() -> None:
    with judge("--freq=10", "--max-time=2") as it:
        for step, value in enumerate((0.1, -0.6, 0.7, float("nan"))):
            answer(it, BEGIN + step * S // 10, step / 10, value)
        verdict = decided(it, 0.35)
    assert verdict.reason == (
        "the lowest groundSteering is -0.6 (at least -0.5); the highest groundSteering is 0.7 (at most 0.5); "
        "1 value is not a finite number, the first is groundSteering at 0.30 s"
    )
    bounds = {check.name: (check.limit, check.parameters) for check in verdict.checks if check.parameters}
    assert bounds == {"lowest": ({"min": -0.5}, ("min",)), "highest": ({"max": 0.5}, ("max",))}


def test_without_a_field_all_numbers_have_to_be_finite() -> None:
    position = "opendlv.logic.sensation.Geolocation"
    with built("responds", f"--message={position}", "--freq=10", "--max-time=2", "--min-frames=1") as it:
        it.begin(BEGIN)
        it.arrived = BEGIN
        hand(it, position, BEGIN, 0, latitude=1.0, heading=float("inf"))
        assert decided(it, 0.05).reason == "1 value is not a finite number, the first is heading at 0.00 s"


def test_silence_never_passes_and_no_frame_is_no_verdict() -> None:
    with judge("--freq=10", "--max-time=2", "--min-share=0") as it:
        verdict = decided(it, 1)
    assert (verdict.outcome, verdict.silent) == ("failed", True)
    assert verdict.reason == f"no {STEERING}/0 came before the input ended after 1.00 s"
    with judge("--freq=10", "--max-time=2") as it, pytest.raises(UnjudgeableError, match=r"^no frame came within"):
        it.update(BEGIN + S // 2)
        it.conclude(JudgedTime("within 0.50 s", "for 0.50 s"))


def test_frames_before_the_first_answer_may_be_unanswered_as_programs_start_slowly() -> None:
    for first, share in ((2, 1.0), (4, 7 / 11)):
        with judge("--freq=1", "--max-time=10.5") as it:
            for step in range(first, 11):
                answer(it, BEGIN + step * S, step + 0.1)
            assert values(decided(it, 10.4))["share"] == pytest.approx(share)


@pytest.mark.parametrize("timemod", [1.0, 4.0])
def test_frames_are_due_as_the_player_shows_them(tmp_path: Path, timemod: float) -> None:
    """Of a recording with holes, against the player's own times."""
    from dodo_dsl.opendlv.recording import Recording

    random = np.random.default_rng(5)
    path = pictures(tmp_path, *np.cumsum(random.exponential(0.7, 60)))
    with Recording(path) as recording:
        part = select(recording, MESSAGES, 800_000, start=3, end=30, camera=2, timemod=timemod)
    frames = of_recording(path, 2, 3, 30, 0.8, timemod)
    assert len(frames.due) > 20 and frames.due.tolist() == part.due[part.shown].tolist()


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        ((ANSWER[0], "--freq=1", "--min=1"), "--min and --max need --field, the number that they are bounds of"),
        ((ANSWER[0], "--field=x", "--freq=1"), f"{STEERING} has no number 'x', expected one of groundSteering"),
        ((*ANSWER[:2], "--min=1", "--max=-1", "--freq=1"), "--min=1 is more than --max=-1"),
        ((*ANSWER, "--freq=1", "--max-time=1"), "no frame would be judged: --max-time must be longer than --max-delay"),
        ((*ANSWER, "--rec=REC"), "REC: has no pictures of sender 0 in the part that is played"),
    ],
)  # fmt: skip
def test_flags_that_leave_something_open_are_refused(tmp_path: Path, flags: tuple[str, ...], said: str) -> None:
    path = str(pictures(tmp_path, 0))
    assert refusal("responds", *(word.replace("REC", path) for word in flags)) == said.replace("REC", path)


@pytest.mark.parametrize("is_copied", [True, False])
def test_frames_that_were_not_shown_need_no_answer(is_copied: bool, tmp_path: Path) -> None:
    """Of 20 frames 5 were not shown; what came then answers the frame before, and one that was shown has no answer."""
    with judge(f"--rec={pictures(tmp_path, *[step / 10 for step in range(20)])}", "--video-sender=2") as it:
        for step in (0, 1, 10, 11, 12):
            hide(it, BEGIN + S + step * S // 10, BEGIN + S + (step + 1) * S // 10, step)
        for step in (2, 3, 4, 5, 6, 7, 8, 13, 14, 15, 16, 17, 18, 19):
            stamp = T0 + step * S // 10 if is_copied else 0
            answer(it, stamp, 1.05 + step / 10)
        answer(it, 0, 2.15)
        verdict = decided(it, 4)
    assert (values(verdict)["frames"], values(verdict)["late"]) == (15, 0)
    assert values(verdict)["share"] == 1.0


@pytest.mark.parametrize(("sent", "is_kept"), [(0.3, True), (0.29999998, True), (0.30000004, False), (0.31, False)])
def test_a_value_is_what_it_was_before_it_became_a_single(sent: float, is_kept: bool) -> None:
    with built("responds", *ANSWER[:2], "--max=0.3", "--min-frames=1", "--freq=10", "--max-time=2") as it:
        it.begin(BEGIN)
        for step in range(3):
            answer(it, BEGIN + step * S // 10, step / 10 + 0.05, sent)
        verdict = decided(it, 0.25)
    assert (verdict.outcome == "passed") == is_kept
    assert values(verdict)["highest"] == (0.3 if sent == 0.3 else pytest.approx(sent))
    assert [*it.notes] == ([f"all 3 answers have the same groundSteering, {sent:.4g}"] if is_kept else [])
