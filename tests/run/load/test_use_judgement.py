"""What the use of processors and memory means for a test."""

from dataclasses import replace

import pytest

from dodo_dsl.outcome import ServiceUse, differs_each_run, with_margin
from dodo_dsl.run.machine_load.judgement import UNSEEN_USE, judged_use
from dodo_dsl.spec.model import ResourceLimits

QUIET = ServiceUse("steering", 1.5, 0.25, 150_000_000, 0.0, 2_000_000_000)
LEAKS = replace(QUIET, service="vision", peak_memory_bytes=1_460_000_000, memory_growth_bytes_per_s=300e6)


def test_a_quiet_application_has_nothing_to_say() -> None:
    found = judged_use([QUIET], None)
    assert (found.findings, found.checks, found.notes) == ((), (), ())


def test_memory_that_is_full_soon_is_a_note() -> None:
    found = judged_use([QUIET, LEAKS], None)
    assert (found.findings, found.checks) == ((), ())
    assert found.notes == (
        "the memory of application service 'vision' grows by 300 MB in a second of test time, to 1,460 MB so far: "
        "it would reach its limit of 2,000 MB in 2 s",
    )


@pytest.mark.parametrize(("growth", "told"), [(1.0e6, "in 9 min"), (0.89e6, ""), (20e6, "in 27 s"), (None, "")])
def test_soon_is_ten_minutes(growth: float | None, told: str) -> None:
    notes = judged_use([replace(LEAKS, memory_growth_bytes_per_s=growth)], None).notes
    assert [note.rpartition("MB ")[2] for note in notes] == ([told] if told else [])
    assert judged_use([replace(LEAKS, memory_limit_bytes=None)], None).notes == (), "without a limit"


@pytest.mark.parametrize(
    ("limits", "name", "check", "reason"),
    [
        (
            ResourceLimits(max_memory_mb=1459.0),
            "peak-memory",
            (1460.0, "MB"),
            "used 1,460 MB of memory, at most 1,459 MB",
        ),
        (
            ResourceLimits(max_memory_growth=1.0),
            "memory-growth",
            (18000.0, "MB/min"),
            "grew by 1.8e+04 MB/min in memory, at most 1 MB/min",
        ),
        (
            ResourceLimits(max_processor_time_s=1.4),
            "processor-time",
            (1.5, "s"),
            "took 1.50 s of processor time, at most 1.4 s",
        ),
        (
            ResourceLimits(max_processor_share=0.2),
            "processor-share",
            (0.25, ""),
            "took 25 % of a processor, at most 20 %",
        ),
    ],
)
def test_limits(limits: ResourceLimits, name: str, check: tuple[float, str], reason: str) -> None:
    (most,) = (value for value in vars(limits).values() if value is not None)
    found = judged_use([LEAKS], limits)
    expected = {"name": f"{name}-vision", "value": check[0], "limit": {"max": most}, "unit": check[1], "ok": False}
    assert found.checks == (with_margin(expected),)
    assert differs_each_run(found.checks[0]["name"])
    (finding,) = found.findings
    assert (finding.result, finding.service) == ("failed", "vision")
    assert finding.reason == f"application service 'vision' {reason}"
    assert not finding.is_verdict, "a busy machine is no excuse"


def test_each_service_is_judged() -> None:
    found = judged_use([LEAKS, QUIET], ResourceLimits(max_memory_mb=200.0, max_processor_share=1.0))
    names = ["peak-memory-vision", "processor-share-vision", "peak-memory-steering", "processor-share-steering"]
    assert [(check["name"], check["ok"]) for check in found.checks] == list(
        zip(names, (False, True, True, True), strict=True)
    )
    assert len(found.findings) == 1


def test_what_cannot_be_judged_is_said() -> None:
    limits = ResourceLimits(max_memory_growth=1.0)
    assert judged_use([], limits).notes == (UNSEEN_USE,)
    (note,) = judged_use([replace(QUIET, memory_growth_bytes_per_s=None)], limits).notes
    assert note == "memory-growth of service 'steering' is not judged: the test was too short to measure it"
