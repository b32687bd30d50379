"""One test from set-up to outcome, on a backend that reports given events."""

import asyncio
import signal
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from dodo_dsl.outcome import MachineLoad, Outcome
from dodo_dsl.plan.model import LAYERS, Application, ApplicationService, Flag, Lockstep, Plan
from dodo_dsl.run import listeners
from dodo_dsl.run.engine import (
    LAST_TIME_PATIENCE_S,
    LISTEN_PATIENCE_S,
    LISTEN_PERIOD_S,
    READY_PATIENCE_S,
    Engine,
)
from dodo_dsl.run.machine_load.service_use import Snapshot, Used
from dodo_dsl.run.protocol import (
    BackendError,
    Event,
    Exited,
    Finding,
    Flooded,
    Foreign,
    InputEnded,
    Late,
    MemoryTaken,
    Noted,
    Overrun,
    Paused,
    Ready,
    Started,
    Stopped,
    Time,
    VerdictEvent,
)
from dodo_dsl.spec.model import ResourceLimits
from tests.run.scripted import BUSY, FAILED, PASSED, READY, Events, ScriptedBackend, drives, load, plan, run

ENDED = Exited("track", 0)


def outcome(backend: ScriptedBackend, keep: bool = False) -> Outcome:
    return run(Engine(backend.plan, backend, lambda _: None).run(keep))[0]


def begun(*events: tuple[float, Event], tested: Plan | None = None) -> Outcome:
    """The outcome of a test whose services get ready after 1 s each, and then report events."""
    return outcome(ScriptedBackend(tested or plan(), {**READY, "begin": events}))


def test_layers_start_in_order_and_times_are_measured() -> None:
    said: list[str] = []
    backend = ScriptedBackend(plan(), drives(5.0), {"open": 3.0, "close": 4.0})
    found, kept = run(Engine(backend.plan, backend, said.append).run())
    assert backend.calls == ["open", *LAYERS, "begin", "close"]
    phases = ["setting up", *(f"waiting for {layer}" for layer in LAYERS), "running", "taking down"]
    assert (said, kept) == (phases, [])
    assert (found.outcome, found.reason, found.setup_s, found.execution_s) == ("passed", "it drove", 5.0, 5.0)
    assert (found.cid, found.backend, found.seed, found.last_lines) == (131, "process", 7, ())
    assert [(row["name"], row["layer"], row["exit_code"]) for row in found.services] == [
        ("camera", "environment", None),
        ("track", "evaluation", 0),
        ("app", "application", None),
    ]


@pytest.mark.parametrize("verdict", [PASSED, FAILED])
@pytest.mark.parametrize("keep", [False, True])
def test_that_it_has_passed_is_told_before_it_is_taken_down(verdict: VerdictEvent, keep: bool) -> None:
    backend = ScriptedBackend(plan(), {**READY, "begin": [(1.0, verdict), (1.0, ENDED)]})
    told: list[str] = []
    run(Engine(backend.plan, backend, lambda _: None, passed=lambda: told.append(backend.calls[-1])).run(keep))
    assert told == (["begin"] if verdict is PASSED and not keep else [])


def on(loads: Callable[[float], Snapshot | None], *events: tuple[float, Event], tested: Plan | None = None) -> Outcome:
    """The outcome of a test on a machine that is loaded."""
    return outcome(ScriptedBackend(tested or plan(), {**READY, "begin": events}, uses=loads))


def test_a_failure_on_a_busy_machine_is_an_error_and_a_pass_stays_one() -> None:
    failed = on(BUSY, (5.0, FAILED), (5.0, ENDED))
    assert failed.outcome == "error"
    assert failed.reason.startswith("the machine was too busy to judge: app waited 1.5 s of 5.0 s for a processor")
    passed = on(BUSY, (5.0, PASSED), (5.0, ENDED))
    assert (passed.outcome, passed.reason) == ("passed", "it drove")
    for found in (failed, passed):
        assert found.machine is not None
        assert (found.machine.duration_s, found.machine.undecided) == (5.0, found is failed)


def test_pictures_that_come_late() -> None:
    """Those of the camera, and the updates of others; rarely is no harm."""
    flags = (Flag("name.argb", "video0.argb", "memory"),)
    camera, judge = plan().services
    seeing = plan(services=(replace(camera, flags=flags), judge))
    calm = load(0.85, app=(0.1, 0.01))
    ending = ((5.0, FAILED), (5.0, ENDED))
    late = on(calm, (1.0, Late("camera", 10, 1, 0.2)), (4.0, Late("camera", 40, 20, 0.3)), *ending, tested=seeing)
    assert "judge: 50 % of the pictures came late, by up to 0.30 s, others took 85 % of the processor" in late.reason
    assert late.outcome == "error"
    assert late.machine is not None
    assert (late.machine.late_pictures_share, late.machine.late_updates_share, late.machine.lateness_s) == (0.5, 0, 0.3)


def test_an_emulated_rig_that_stood_still() -> None:
    """Also when that is read after the verdict: what failed is in error, what passed has passed."""
    calm = load(0.2, app=(0.1, 0.01))
    before = on(calm, (1.0, Paused("pose", 0.06)), (2.0, Paused("pose", 0.15)), (5.0, FAILED), (5.0, ENDED))
    after = on(calm, (5.0, FAILED), (5.0, ENDED), (5.0, Paused("pose", 0.15)))
    passed = on(calm, (5.0, PASSED), (5.0, ENDED), (5.0, Paused("pose", 0.15)))
    assert (before.outcome, after.outcome, passed.outcome) == ("error", "error", "passed")
    assert "could not keep real time and stood still for 0.15 s; it found: hit wall left" in before.reason
    assert passed.machine is not None and passed.machine.paused_s == 0.15


def test_what_is_not_measured() -> None:
    found = on(lambda _: None, (5.0, FAILED), (5.0, ENDED))
    assert (found.outcome, found.machine) == ("failed", MachineLoad(5.0))
    stepped = on(BUSY, (5.0, FAILED), (5.0, ENDED), (5.0, Time(5.0, last=True)), tested=plan(lockstep=9.0))
    assert (stepped.outcome, stepped.machine) == ("failed", None), "lockstep waits for a busy machine"


def using(used: Callable[[float], Snapshot | None], **more: Any) -> ScriptedBackend:
    """A test of 5 s, in lockstep of 20 s test time."""
    times = [(0.25 * n, Time(1.0 * n, False)) for n in range(21)]
    events = [*times, (5.0, PASSED), (5.0, ENDED), (5.0, Time(20.0, True))]
    return ScriptedBackend(plan(**more), {**READY, "begin": events}, uses=used)


def leaking(now: float) -> Snapshot:
    """By 400 MB in all."""
    return Snapshot(now, {"app": Used(0.5 * now, 0.0, 100_000_000 + round(80e6 * (now - 2.0)))})


@pytest.mark.parametrize(("lockstep", "seconds"), [(0.0, 5.0), (60.0, 20.0)])
def test_what_the_application_used_is_by_the_test_s_own_time(lockstep: float, seconds: float) -> None:
    found = outcome(using(leaking, lockstep=lockstep))
    (use,) = found.resources
    assert (found.outcome, use.service) == ("passed", "app")
    assert (use.processor_s, use.processor_share) == (pytest.approx(2.5), pytest.approx(2.5 / seconds))
    assert use.peak_memory_bytes == pytest.approx(500e6, rel=0.01)
    assert found.notes == ()


def test_limits_of_what_the_application_uses_are_judged_before_it_has_passed() -> None:
    backend = using(leaking, resources=ResourceLimits(max_memory_mb=200.0))
    told: list[str] = []
    found, _ = run(Engine(backend.plan, backend, lambda _: None, passed=lambda: told.append("passed")).run())
    assert (found.outcome, told) == ("failed", [])
    assert found.reason == "application service 'app' used 500 MB of memory, at most 200 MB"
    assert [(check["name"], check["ok"]) for check in found.checks] == [("peak-memory-app", False)]


EARLY = "after 2.0 s, before the test was decided"
APP, CAMERA, TRACK = (
    "application service 'app'",
    "service 'camera' of layer environment",
    "service 'track' of layer evaluation",
)
LATE = "evaluator 'track' gave no verdict within the timeout of 10 s"
OVER, GONE = (1.0, InputEnded("camera")), (1.1, Exited("app", 0))
PASSES: list[tuple[float, Event]] = [(3.0, PASSED), (3.0, ENDED)]
FLOOD = "more than 20000 messages came within a second: 98% of it is"


def flood(message: str) -> tuple[float, Event]:
    return 1.0, Flooded("dodo-recorder", FLOOD.partition(":")[0], message, 0, 0.981, True)


CASES: dict[str, tuple[list[tuple[float, Event]], str, str]] = {
    "passes": (PASSES, "passed", "it drove"),
    "fails": ([(1.0, FAILED), (1.0, ENDED)], "failed", "hit wall left"),
    "application ends with 0": ([(2.0, Exited("app", 0))], "failed", f"{APP} ended with exit code 0 {EARLY}"),
    "application is out of memory": ([(2.0, Exited("app", 137, True))], "failed", f"{APP} ran out of memory {EARLY}"),
    "application ends after the verdict": ([PASSES[0], (3.1, Exited("app", 3)), (3.2, ENDED)], "passed", "it drove"),
    "application ends after the input": ([OVER, GONE, *PASSES], "passed", "it drove"),
    "application crashes after the input": (
        [OVER, (2.0, Exited("app", 3)), *PASSES], "failed", f"{APP} ended with exit code 3 {EARLY}",
    ),
    "camera crashes": ([(2.0, Exited("camera", 1))], "error", f"{CAMERA} ended with exit code 1 after 2.0 s"),
    "camera crashes after the verdict": (
        [(1.0, PASSED), (2.0, Exited("camera", 1)), (3.0, ENDED)],
        "error", f"{CAMERA} ended with exit code 1 after 2.0 s",
    ),
    "evaluator crashes after its verdict": (
        [(1.0, FAILED), (1.0, Exited("track", 2))], "error", f"{TRACK} ended with exit code 2 after 1.0 s",
    ),
    "no verdict": ([(1.0, ENDED)], "error", "evaluator 'track' ended without a verdict after 1.0 s"),
    "two verdicts": (
        [(1.0, PASSED), (1.0, PASSED), (1.0, ENDED)], "error", "evaluator 'track' gave 2 verdicts, expected one",
    ),
    "application floods": ([flood("a.M")], "failed", f"{FLOOD} a.M/0, which only the application can have sent"),
    "application keeps a memory": (
        [(1.0, MemoryTaken("camera", "it is locked"))],
        "failed", "the application keeps service 'camera' from its shared memory: it is locked",
    ),
    "timeout": ([], "error", LATE),
    "backend is gone": ([(1.0, Finding("error", "the engine went away"))], "error", "the engine went away"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_happens_after_the_begin(case: str) -> None:
    events, expected, reason = CASES[case]
    found = begun(*events)
    assert (found.outcome, found.reason) == (expected, reason)


ILL = "ended with exit code 1 during set-up"
SET_UP: dict[str, tuple[dict[str, Events], str]] = {
    "camera ends early": (
        {"environment": [(1.0, Exited("camera", 0))]},
        f"{CAMERA} ended with exit code 0 during set-up, before it was ready",
    ),
    "camera crashes": ({"environment": [(1.0, Exited("camera", 1))]}, f"{CAMERA} {ILL}"),
    "camera crashes when it is ready": (
        {**READY, "evaluation": [(0.5, Exited("camera", 1)), (1.0, Ready("track"))]},
        f"{CAMERA} {ILL}",
    ),
    "an early verdict": (
        {**READY, "evaluation": [(0.5, PASSED)]},
        "evaluator 'track' gave a verdict before the test began",
    ),
    "never ready": ({"environment": []}, f"service 'camera' was not ready within {READY_PATIENCE_S:g} s"),
}


@pytest.mark.parametrize("case", SET_UP)
def test_what_happens_during_set_up(case: str) -> None:
    stages, reason = SET_UP[case]
    backend = ScriptedBackend(plan(), stages)
    found = outcome(backend)
    assert (found.outcome, found.reason) == ("error", reason)
    assert (found.setup_s, found.execution_s, backend.calls[-1]) == (None, None, "close")
    assert "begin" not in backend.calls


def test_a_service_with_a_longer_set_up_is_waited_for() -> None:
    late = READY_PATIENCE_S + 5.0
    stages = {**drives(), "environment": [(late, Ready("camera"))]}
    tested = plan()
    camera, track = tested.services
    patient = replace(tested, services=(replace(camera, setup_s=10.0), track))
    assert outcome(ScriptedBackend(patient, stages)).outcome == "passed"
    assert (
        outcome(ScriptedBackend(tested, stages)).reason
        == f"service 'camera' was not ready within {READY_PATIENCE_S:g} s"
    )


@pytest.mark.parametrize("problem", [BackendError("no subnet is free"), OSError(28, "full"), ValueError("odd")])
def test_a_backend_that_does_not_open_is_closed(problem: Exception) -> None:
    backend = ScriptedBackend(plan(), problem=problem)
    if isinstance(problem, BackendError):
        found = outcome(backend)
        assert (found.outcome, found.reason) == ("error", "no subnet is free")
    else:
        with pytest.raises(type(problem)):
            outcome(backend)
    assert backend.calls[-1] == "close"


def test_what_the_application_must_not_send_fails_the_test_whenever_it_is_read() -> None:
    reason = "the application sent opendlv.sim.Frame/0, which only 'pose' may send"
    begun, *rest = drives()["begin"]
    for stages in (
        {**drives(), "begin": [begun, (begun[0], Foreign(reason)), *rest]},
        {**drives(), "application": [*drives().get("application", []), (0.0, Foreign(reason))]},
        {**drives(), "close": [(0.0, Foreign(reason))]},
    ):
        found = outcome(ScriptedBackend(plan(), stages))
        assert (found.outcome, found.reason) == ("failed", reason)


def test_a_verdict_says_what_the_application_is_told() -> None:
    told = "the application gets its true pose (opendlv.sim.Frame)"
    lost: dict[str, Events] = {**READY, "begin": [(1.0, Finding("error", "gone"))]}
    for stages, expected in ((drives(), f"it drove; {told}"), (lost, "gone")):
        found = outcome(ScriptedBackend(replace(plan(), told=("opendlv.sim.Frame",)), stages))
        assert found.reason == expected


@pytest.mark.parametrize(
    ("code", "how"),
    [
        (-signal.SIGSEGV, "was killed by SIGSEGV"),
        (128 + signal.SIGABRT, "was killed by SIGABRT"),
        (3, "ended with exit code 3"),
        (-signal.SIGKILL, "did not end upon SIGTERM and was killed"),
        *((code, "") for code in (0, -signal.SIGTERM, 128 + signal.SIGTERM)),
    ],
)
def test_how_the_application_ends_is_noted_and_no_verdict(code: int, how: str) -> None:
    closed = {"begin": [(0.5, Time(4.0, last=True)), *drives()["begin"]], "close": [(0.0, Exited("app", code))]}
    for lockstep, after in ((0.0, "5.0 s"), (60.0, "4.0 s of test time")):
        found = outcome(ScriptedBackend(plan(lockstep=lockstep), {**drives(), **closed}))
        told = (f"application service 'app' {how} as the test ended, after {after}",) if how else ()
        assert (found.outcome, found.notes) == ("passed", told)
    early = begun((4.0, PASSED), (4.5, Exited("app", code)), (5.0, ENDED)).notes
    told = (f"application service 'app' {how} when all was judged, after 4.5 s",) if how else ()
    assert code == -signal.SIGKILL or early == told


def test_losses_and_notes_count_until_teardown_has_ended_and_nothing_else_does() -> None:
    late: Events = [
        (0.0, event) for event in (Overrun("camera", 30), Noted("a file is missing"), FAILED, Exited("camera", 1))
    ]
    stages = {**drives(), "close": late}
    stages["begin"] = [(0.5, Overrun("camera", 7)), (0.6, Overrun("track", 1)), *stages["begin"]]
    found = outcome(ScriptedBackend(plan(), stages))
    assert (found.outcome, found.notes) == (
        "passed",
        (
            "a file is missing",
            "service 'camera' lost 30 messages, because its receive buffer was full: it worked without them",
            "service 'track' lost 1 message, because its receive buffer was full: its verdict does not consider them",
        ),
    )


def cancelled(backend: ScriptedBackend, *seconds: float) -> tuple[Outcome, float]:
    """The outcome of a test that is cancelled at these times, and when it had ended."""

    async def scene() -> tuple[Outcome, float]:
        loop = asyncio.get_running_loop()
        task = asyncio.ensure_future(Engine(backend.plan, backend, lambda _: None).run())
        for when in seconds:
            loop.call_later(when, task.cancel)
        return (await task)[0], loop.time()

    return run(scene())


@pytest.mark.parametrize("when", [0.5, 4.0], ids=["open", "running"])
def test_an_interrupt_is_an_error_after_teardown(when: float) -> None:
    backend = ScriptedBackend(plan(), drives(), {"open": 1.0, "close": 3.0})
    found, ended = cancelled(backend, when)
    assert (found.outcome, found.reason, ended) == ("error", "the run was interrupted", when + 3.0)


def test_interrupts_during_teardown_keep_verdict_and_teardown() -> None:
    backend = ScriptedBackend(plan(), drives(5.0), {"close": 3.0})
    found, ended = cancelled(backend, 8.0, 8.5, 9.0)
    assert (found.outcome, found.reason, ended) == ("passed", "it drove", 10.0)


def test_an_error_of_teardown_is_a_note_and_no_verdict() -> None:
    backend = ScriptedBackend(plan(), drives(), close_problem=ValueError("odd"))
    assert outcome(backend).notes == ("not all of the test was taken down: ValueError: odd",)
    assert outcome(ScriptedBackend(plan(), drives(), close_problem=ValueError("odd"))).outcome == "passed"


def clocked(*events: tuple[float, Event], wall_s: float = 60.0) -> ScriptedBackend:
    """A test in lockstep, which begins at 2 s."""
    return ScriptedBackend(plan(lockstep=wall_s), {**READY, "begin": events})


CRASH, BEGUN = (3.0, Exited("app", 1)), (0.1, Time(0.0, False))
CRASHED = "application service 'app' ended with exit code 1, before the test was decided"
HIT = VerdictEvent("track", False, "hit wall left after 2.10 s", ())
IN_LOCKSTEP: dict[str, tuple[list[tuple[float, Event]], str, str, float | None]] = {
    "passes": ([BEGUN, (30.0, PASSED), (30.0, ENDED), (31.0, Time(120.0, True))], "passed", "it drove", 120.0),
    "crashes": ([BEGUN, CRASH, (3.0, Time(40.5, True))], "failed", f"{CRASHED}, after 40.5 s of test time", 40.5),
    "crashes at a time that the clock did not tell": ([(0.1, Time(40.0, False)), CRASH], "failed", CRASHED, 40.0),
    "has no verdict": (
        [BEGUN, (3.0, ENDED), (3.0, Time(0.5, True))],
        "error",
        "evaluator 'track' ended without a verdict, after 0.5 s of test time",
        0.5,
    ),
    "fails at its own time": ([(1.0, HIT), (1.0, ENDED), (1.5, Time(2.1, True))], "failed", HIT.reason, 2.1),
    "never begins": ([], "error", "the test took more than 60 s of wall time", None),
    "takes too long": (
        [BEGUN, (3.0, Time(12.0, False))],
        "error",
        "the test took more than 60 s of wall time and reached 12.0 s of test time",
        12.0,
    ),
}


@pytest.mark.parametrize("case", IN_LOCKSTEP)
def test_what_happens_in_lockstep_is_told_at_its_test_time(case: str) -> None:
    """The same in every run, and as the page of the drive counts: wall time is neither."""
    events, expected, reason, sim_s = IN_LOCKSTEP[case]
    found = outcome(clocked(*events))
    assert (found.outcome, found.reason, found.sim_s) == (expected, reason, sim_s)


@pytest.mark.parametrize(
    ("more", "ended"), [([], 32.0 + LAST_TIME_PATIENCE_S), ([(30.5, Exited("dodo-clock", 0))], 32.5)]
)
def test_the_last_time_is_not_waited_for_without_end(more: list[tuple[float, Event]], ended: float) -> None:
    backend = clocked((0.1, Time(9.0, False)), (30.0, PASSED), (30.0, ENDED), *more)
    found, end = cancelled(backend)
    assert (found.outcome, found.sim_s, end) == ("passed", 9.0, ended)


STOPS: list[tuple[str, str, str, Callable[[Outcome], bool]]] = [
    ("unanswered", "failed", "'app' has not answered picture 3", lambda o: o.last_lines == ("app says",)),
    ("stuck", "error", "service 'camera' is stuck", lambda o: o.last_lines == ("clock says",)),
    ("timedout", "error", "evaluator 'track' gave no verdict within the timeout of 10 s", lambda o: not o.last_lines),
]


@pytest.mark.parametrize(("kind", "expected", "reason", "has_lines"), STOPS, ids=[stop[0] for stop in STOPS])
def test_a_clock_that_stops(kind: str, expected: str, reason: str, has_lines: Callable[[Outcome], bool]) -> None:
    backend = clocked((0.1, Time(0.0, False)), (5.0, Stopped(kind, reason)))
    backend.tails = {"app": ["app says"], "dodo-clock": ["clock says"]}
    found = outcome(backend)
    assert (found.outcome, found.reason) == (expected, reason)
    assert has_lines(found)


def consuming(listens: dict[str, float] | None, stages: dict[str, Events] | None = None) -> ScriptedBackend:
    """An application of two programs, of which the second consumes messages of the first."""
    services = (ApplicationService("lane", outputs=("team.Lane",)), ApplicationService("driver", inputs=("team.Lane",)))
    tested = plan(application=Application(".", services))
    return ScriptedBackend(tested, stages or drives(), listens=listens)


def test_it_begins_when_those_listen_that_consume_messages() -> None:
    found = outcome(consuming({"driver": 6.0}))
    assert (found.outcome, found.notes) == ("passed", ())
    assert found.setup_s == pytest.approx(6.0, abs=LISTEN_PERIOD_S)
    assert outcome(consuming({"lane": 0.0, "driver": 0.0})).setup_s == 2.0
    assert outcome(consuming(None)).setup_s == 2.0, "nobody can see them"


def test_who_never_listens_is_waited_for_only_so_long() -> None:
    found = outcome(consuming({"lane": 0.0}))
    told = "'driver', which consumes messages, had not joined the bus after 10 s: what others sent before is lost"
    assert (found.outcome, found.notes) == ("passed", (told,))
    assert found.setup_s == pytest.approx(2.0 + LISTEN_PATIENCE_S, abs=LISTEN_PERIOD_S)


def test_in_lockstep_it_begins_when_the_application_rests() -> None:
    backend = consuming({}, {**drives(), "application": [(6.0, Started())]})
    backend.plan, backend.by_answers = replace(backend.plan, lockstep=Lockstep(1, 60.0)), False
    found = outcome(backend)
    assert (found.outcome, found.notes, found.setup_s) == ("passed", (), pytest.approx(8.0))


@pytest.mark.parametrize(
    ("joined", "silent", "told"),
    [
        ({131, 111}, True, "; the test is on CID 131; the application talks on CID 111; write x-dodo: {cid: 111}"),
        ({131}, True, "; the test is on CID 131"),
        ({131, 111}, False, ""),
    ],
)
def test_the_bus_of_an_application_that_is_silent_on_the_test_s(
    joined: set[int], silent: bool, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listeners, "buses", lambda processes: joined if list(processes) == [17] else set())
    verdict = VerdictEvent("track", False, "nothing came", (), silent=silent)
    assert begun((3.0, verdict), (3.1, ENDED)).reason == f"nothing came{told}"


@pytest.mark.parametrize(
    ("event", "never", "reason", "notes"),
    [
        (Stopped("unanswered", "no answer to frame 3"), True, "no answer to frame 3; 'app' printed no line", ()),
        (Stopped("stuck", "service 'camera' is stuck"), True, "service 'camera' is stuck", ()),
        (FAILED, True, FAILED.reason, ("'app' printed no line",)),
        (PASSED, False, PASSED.reason, ()),
    ],
)
def test_what_an_application_printed_in_place_of_an_answer_is_told(
    event: Event, never: bool, reason: str, notes: tuple[str, ...]
) -> None:
    backend = clocked((0.1, Time(0.0, False)), (5.0, event), (5.0, ENDED))
    backend.printed = ("'app' printed no line",) if never else ()
    found = outcome(backend)
    assert (found.reason, found.notes) == (reason, notes)
