"""When a failure is an error: the machine was too busy, and it was not the application that kept it so."""

from dataclasses import replace

import pytest

from dodo_dsl.outcome import MachineLoad, Wait
from dodo_dsl.run.machine_load.judgement import consider
from dodo_dsl.run.outcomes import Finding

CALM = MachineLoad(
    7.5, 2, Wait(1.0, 0.9, 0.7, "perception"), Wait(1.5, 0.5, 0.4, "camera"), 0.61, 7.5, 0.05, 0.05, 0.06
)
CROWDED = replace(CALM, application=Wait(1.0, 2.0, 1.9, "perception"))
FAILED = Finding("failed", "only 43 frames had an answer (at least 50)", "judge", is_verdict=True)


def test_a_failure_on_a_busy_machine_is_an_error() -> None:
    finding, load = consider(FAILED, CROWDED)
    assert finding == Finding(
        "error",
        "the machine was too busy to judge: perception waited 1.9 s of 7.5 s for a processor, others took 71 % of it; "
        "it found: only 43 frames had an answer (at least 50); "
        "run it with --clock lockstep, or fewer tests at once (-j 1)",
        "judge",
        is_verdict=True,
    )
    assert load == replace(CROWDED, undecided=True)


def test_lockstep_is_no_way_out_for_an_application_with_a_clock_of_its_own() -> None:
    reason = consider(FAILED, CROWDED, is_timed=True)[0].reason
    assert reason.endswith(
        "; the application acts by its own clock: run it on a quiet machine (-j 1), or with --clock virtual, not in "
        "lockstep"
    )
    assert "--clock lockstep" not in reason


@pytest.mark.parametrize(
    ("load", "why"),
    [
        (replace(CALM, late_pictures_share=0.2), "20 % of the pictures came late, by up to 0.06 s"),
        (
            replace(CALM, late_updates_share=0.2),
            "20 % of the updates of one of DoDo's services came late, by up to 0.06 s",
        ),
    ],
    ids=["pictures", "updates"],
)
def test_what_hinders_dodo_is_no_fault_of_the_application(load: MachineLoad, why: str) -> None:
    assert consider(FAILED, load)[0].reason.startswith(f"the machine was too busy to judge: {why}, others took 71 %")


@pytest.mark.parametrize("load", [CALM, MachineLoad(7.5)], ids=["measured", "not measured"])
def test_an_emulated_rig_that_stood_still_is_no_rig(load: MachineLoad) -> None:
    paused = replace(load, paused_s=0.061)
    finding, found = consider(FAILED, paused)
    assert finding.reason.startswith(
        "the machine was too busy to judge: the emulated rig could not keep real time and stood still for 0.06 s; it "
    )
    assert found == replace(paused, undecided=True)
    passed = Finding("passed", "it drove", "judge", is_verdict=True)
    assert consider(passed, paused)[0] == passed


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
        "lockstep",
        "calm",
        "services that keep to their schedule",
        "not measured",
        "its own threads",
        "late by the application's fault",
        "over at once",
    ],
)
def test_a_failure_stays_one(load: MachineLoad | None) -> None:
    assert consider(FAILED, load) == (FAILED, load)


@pytest.mark.parametrize(
    "finding",
    [
        replace(FAILED, result="passed"),
        replace(FAILED, result="error"),
        Finding("failed", "application service 'app' ended with exit code 3 after 2.0 s", "app"),
    ],
    ids=["passed", "error", "crashed"],
)
def test_what_does_not_depend_on_time_stays(finding: Finding) -> None:
    assert consider(finding, CROWDED) == (finding, CROWDED)


def test_a_long_reason_is_cut() -> None:
    assert f"it found: {'x' * 300}...; run it" in consider(replace(FAILED, reason="x" * 2000), CROWDED)[0].reason
