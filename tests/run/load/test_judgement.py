"""When a failure is an error as the machine was too busy, and what answers and use mean for a test."""

from dataclasses import replace

import pytest

from dodo_dsl.outcome import (
    SAMPLE_TIMES,
    SLOW_ANSWERS,
    MachineLoad,
    Response,
    ServiceUse,
    Wait,
    differs_each_run,
    with_margin,
)
from dodo_dsl.plan.model import Lockstep
from dodo_dsl.run.machine_load.judgement import (
    UNMEASURED,
    JudgedFigures,
    consider,
)
from dodo_dsl.run.protocol import Finding
from dodo_dsl.spec.model import ResourceLimits

CALM = MachineLoad(
    7.5, 2, Wait(1.0, 0.9, 0.7, "perception"), Wait(1.5, 0.5, 0.4, "camera"), 0.61, 7.5, 0.05, 0.05, 0.06
)
CROWDED = replace(CALM, application=Wait(1.0, 2.0, 1.9, "perception"))
FAILED = Finding("failed", "only 43 frames had an answer (at least 50)", "judge", cause="verdict")
CRASHED = Finding("failed", "application service 'app' ended with exit code 3 after 2.0 s", "app")


@pytest.mark.parametrize(
    ("load", "why"),
    [
        (CROWDED, "perception waited 1.9 s of 7.5 s for a processor, others took 71 % of the processor"),
        (replace(CALM, late_pictures_share=0.2), "20 % of the pictures came late, by up to 0.06 s, others took 71 %"),
        (replace(CALM, late_updates_share=0.2), "20 % of the updates of one of DoDo's services came late, by up to"),
        (replace(CALM, paused_s=0.061), "the emulated rig could not keep real time and stood still for 0.06 s; it "),
        (MachineLoad(7.5, paused_s=0.061), "the emulated rig could not keep real time and stood still for 0.06 s; it "),
    ],
    ids=["waits", "late pictures", "late updates", "paused", "only paused is measured"],
)
def test_a_failure_on_a_busy_machine_is_an_error(load: MachineLoad, why: str) -> None:
    finding, found = consider(FAILED, load)
    assert (finding.result, finding.service, found) == ("error", "judge", replace(load, undecided=True))
    assert finding.reason.startswith(f"the machine was too busy to judge: {why}")
    assert "; it found: only 43 frames had an answer (at least 50); run it with --clock lockstep" in finding.reason

    for other in (replace(FAILED, result="passed"), replace(FAILED, result="error"), CRASHED):
        assert consider(other, load) == (other, load), "does not depend on time"


@pytest.mark.parametrize(
    "load",
    [
        None,
        CALM,
        replace(CALM, services=Wait(1.5, 2.0, 2.0, "pose")),
        MachineLoad(7.5, late_pictures_share=0.9),
        replace(CROWDED, application=Wait(12.0, 7.0, 0.3, "perception")),
        replace(CALM, late_pictures_share=0.9, crowded_s=0.5),
        replace(CALM, duration_s=0.5, application=Wait(0.1, 0.2, 0.2, "app"), services=Wait(0.1, 0.2, 0.2, "camera")),
    ],
    ids=[
        "lockstep", "calm", "services that keep to their schedule", "not measured", "its own threads",
        "late by the application's fault", "over at once",
    ],
)  # fmt: skip
def test_a_failure_stays_one(load: MachineLoad | None) -> None:
    assert consider(FAILED, load) == (FAILED, load)


FAST = Response(60, 0.1, 0.012, 0.02, 0.03, 0, None, "Some CPU, 2000 MHz")
PLAIN, LIMITED = Lockstep(1, 60.0), Lockstep(1, 60.0, 0.1, 0.1)
COPIED = replace(PLAIN, is_copied=True)


@pytest.mark.parametrize(
    ("response", "lockstep", "note"),
    [
        (None, LIMITED, UNMEASURED),
        (FAST, PLAIN, ""),
        (replace(FAST, slow=6, worst_s=1.0), PLAIN, ""),
        (
            replace(FAST, median_s=0.5, p95_s=0.52, worst_s=0.75, slow=58), PLAIN,
            "too slow for real time: 58 of 60 answers took longer than the frames' period of 100 ms; an answer took "
            "500 ms (median), 520 ms (95 %), 750 ms (worst) on the processor, on Some CPU, 2000 MHz",
        ),
    ],
)  # fmt: skip
def test_how_an_application_answers_is_a_note(response: Response | None, lockstep: Lockstep | None, note: str) -> None:
    (found := JudgedFigures()).judge_answers(response, lockstep, ["steering"])
    assert (found.notes, found.findings, found.checks) == ([note] if note else [], [], [])


@pytest.mark.parametrize(
    ("response", "lockstep", "name", "value", "most", "reason"),
    [
        (replace(FAST, over=0), LIMITED, SLOW_ANSWERS, 0.0, 0.1, ""),
        (replace(FAST, over=6), LIMITED, SLOW_ANSWERS, 0.1, 0.1, ""),
        (
            replace(FAST, over=7), LIMITED, SLOW_ANSWERS, 7 / 60, 0.1,
            "7 of 60 answers took longer than 100 ms (at most 10 %): an answer took 12 ms (median)",
        ),
        (FAST, COPIED, SAMPLE_TIMES, 0, 0, ""),
        (
            replace(FAST, uncopied=1), COPIED, SAMPLE_TIMES, 1, 0,
            "1 of 60 answers did not carry the sample time of their frame",
        ),
    ],
)  # fmt: skip
def test_a_limit_of_answers_is_a_check(
    response: Response, lockstep: Lockstep, name: str, value: float, most: float, reason: str
) -> None:
    (found := JudgedFigures()).judge_answers(response, lockstep, ["perception", "steering"])
    check = {"name": name, "value": value, "limit": {"max": most}, "unit": "", "ok": not reason}
    assert found.checks == [with_margin(check)]
    assert [(each.result, each.service) for each in found.findings] == [("failed", "perception")] * bool(reason)
    assert all(each.reason.startswith(reason) for each in found.findings)


QUIET = ServiceUse("steering", 1.5, 0.25, 150_000_000)
TAKES = replace(QUIET, service="vision", peak_memory_bytes=1_460_000_000)


@pytest.mark.parametrize(
    ("key", "most", "name", "value", "unit", "reason"),
    [
        ("max_memory_mb", 1459.0, "peak-memory", 1460.0, "MB", "used 1,460 MB of memory, at most 1,459 MB"),
        ("max_processor_time_s", 1.4, "processor-time", 1.512, "s", "took 1.51 s of processor time, at most 1.4 s"),
        ("max_processor_share", 0.2, "processor-share", 0.25, "", "took 25 % of a processor, at most 20 %"),
    ],
)  # fmt: skip
def test_limits_of_use_are_checks(key: str, most: float, name: str, value: float, unit: str, reason: str) -> None:
    """Of each service, in the order of their names."""
    (found := JudgedFigures()).judge_use([replace(TAKES, processor_s=1.5123)], ResourceLimits(**{key: most}))
    check = {"name": f"{name}-vision", "value": value, "limit": {"max": most}, "unit": unit, "ok": False}
    assert found.checks == [with_margin(check)] and differs_each_run(found.checks[0]["name"])
    assert found.findings == [Finding("failed", f"application service 'vision' {reason}", "vision")], "no verdict"
    (both := JudgedFigures()).judge_use([TAKES, QUIET], ResourceLimits(**{key: value}))
    assert [(each["name"], each["ok"]) for each in both.checks][1:] == [(f"{name}-steering", True)]
