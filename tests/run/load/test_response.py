"""What the times of answers mean for a test."""

from dataclasses import replace

import pytest

from dodo_dsl.outcome import SAMPLE_TIMES, SLOW_ANSWERS, Response, with_margin
from dodo_dsl.plan.model import Lockstep
from dodo_dsl.run.machine_load.judgement import UNSEEN, judged_response

FAST = Response(60, 0.1, 0.012, 0.02, 0.03, 0.01, 0.015, 0.02, 0, None, "Some CPU, 2000 MHz")
PLAIN, LIMITED = Lockstep(1, 60.0), Lockstep(1, 60.0, 0.1, 0.1)


def test_a_fast_application_has_nothing_to_say() -> None:
    found = judged_response(FAST, PLAIN, ["steering"])
    assert (found.findings, found.checks, found.notes) == ((), (), ())


@pytest.mark.parametrize("lockstep", [PLAIN, LIMITED, None])
def test_without_figures_nothing_is_judged(lockstep: Lockstep | None) -> None:
    assert judged_response(None, lockstep, ["steering"]).checks == ()


def test_too_slow_for_real_time_is_a_note() -> None:
    slow = replace(FAST, median_s=0.5, p95_s=0.52, worst_s=0.75, slow=58)
    (note,) = judged_response(slow, PLAIN, ["steering"]).notes
    assert note == (
        "too slow for real time: 58 of 60 answers took longer than the frames' period of 100 ms; "
        "an answer took 500 ms (median), 520 ms (95 %), 750 ms (worst), 10 ms of it on the processor, "
        "on Some CPU, 2000 MHz"
    )
    assert judged_response(replace(slow, slow=6), PLAIN, ["steering"]).notes == (), "a tenth is not the rule"


def test_one_answer_of_many_frames_is_a_note() -> None:
    assert judged_response(replace(FAST, worst_s=1.0), PLAIN, ["steering"]).notes == ()
    (note,) = judged_response(replace(FAST, worst_s=1.5, worst_frame=17), PLAIN, ["steering"]).notes
    assert note == (
        "the answer to frame 17 took 1.5 s, as long as 15 frames, which outside lockstep would not have waited"
    )


def test_a_long_answer_of_containers_may_have_waited() -> None:
    (note,) = judged_response(replace(FAST, worst_s=1.5, processor_median_s=None), PLAIN, ["steering"]).notes
    assert note.startswith("the answer took 1.5 s with what it waited for a processor, as long as 15 frames")


@pytest.mark.parametrize(("over", "passes"), [(0, True), (6, True), (7, False)])
def test_a_limit_is_a_check(over: int, passes: bool) -> None:
    found = judged_response(replace(FAST, over=over), LIMITED, ["perception", "steering"])
    check = {"name": SLOW_ANSWERS, "value": over / 60, "limit": {"max": 0.1}, "unit": "", "ok": passes}
    assert found.checks == (with_margin(check),)
    assert bool(found.findings) is not passes


def test_the_reason_has_the_limit_and_the_times() -> None:
    (finding,) = judged_response(replace(FAST, over=8), LIMITED, ["perception", "steering"]).findings
    assert finding.result == "failed" and finding.service == "perception"
    assert finding.reason.startswith("8 of 60 answers took longer than 100 ms (at most 10 %): an answer took 12 ms (")


def test_where_processes_cannot_be_seen_a_busy_machine_blames_nobody() -> None:
    unseen = replace(FAST, over=7, processor_median_s=None, processor="")
    assert unseen.in_words().endswith("30 ms (worst)")
    found = judged_response(unseen, LIMITED, [])
    assert (found.findings, found.checks, found.notes) == ((), (), (UNSEEN,))
    assert judged_response(replace(unseen, over=6), LIMITED, []).notes == ()


@pytest.mark.parametrize("uncopied", [0, 1, 60])
def test_sample_times_have_to_be_copied_where_the_test_says_so(uncopied: int) -> None:
    found = judged_response(replace(FAST, uncopied=uncopied), replace(LIMITED, is_copied=True), ["perception"])
    (check,) = (check for check in found.checks if check["name"] == SAMPLE_TIMES)
    assert (check["value"], check["limit"], check["ok"]) == (uncopied, {"max": 0}, uncopied == 0)
    reasons = [f"{uncopied} of 60 answers did not carry the sample time of their frame"] if uncopied else []
    assert [finding.reason for finding in found.findings] == reasons
    assert judged_response(replace(FAST, uncopied=uncopied), PLAIN, []).checks == ()


TIMED = replace(FAST, surplus=174, surplus_frames=17, differing=9, pauses=2, unasked=2)
WAY = ": results can differ from run to run; run it with --clock realtime, or --clock virtual"


@pytest.mark.parametrize(
    ("response", "timed", "note"),
    [
        (
            TIMED,
            (),
            "the application acts by its own clock: it sent messages in 2 of 2 pauses without a frame; 174 surplus "
            f"answers in 17 of 61 frames, 9 of them with other values{WAY}",
        ),
        (
            replace(FAST, pauses=2),
            ("driver",),
            f"the application acts by its own clock: 'driver' declares timers (x-dodo: timed){WAY}",
        ),
        (
            replace(TIMED, unasked=0, differing=0),
            (),
            "174 surplus answers in 17 of 61 frames: the first answer to a frame counts, and the others are dropped",
        ),
    ],
    ids=["seen", "declared", "answers more than once"],
)
def test_a_clock_of_its_own_is_a_note_and_no_error(response: Response, timed: tuple[str, ...], note: str) -> None:
    found = judged_response(response, PLAIN, ["driver"], timed)
    assert (found.notes, found.findings, found.checks) == ((note,), (), ())


def test_a_few_surplus_answers_are_no_note() -> None:
    assert judged_response(replace(FAST, surplus=6, surplus_frames=6, pauses=2), PLAIN, []).notes == ()
