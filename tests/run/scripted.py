"""Tests that run without processes: backends that report given events, in an event loop whose clock jumps."""

import asyncio
import contextlib
import os
import selectors
from collections.abc import AsyncIterator, Callable, Collection, Coroutine, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from dodo_dsl.plan.model import Application, ApplicationService, Lockstep, Plan, PlannedService
from dodo_dsl.run.backends import Job
from dodo_dsl.run.machine_load.service_use import Snapshot, Used
from dodo_dsl.run.protocol import BackendError, Event, Exited, Ready, VerdictEvent
from dodo_dsl.run.sides import Backend

T = TypeVar("T")
Events = Sequence[tuple[float, Event]]
"""Events, each with the seconds after the begin of its stage."""
READY: Mapping[str, Events] = {
    "environment": [(1.0, Ready("camera"))],
    "evaluation": [(1.0, Ready("track"))],
}
PASSED = VerdictEvent("track", True, "it drove", ())
FAILED = VerdictEvent("track", False, "hit wall left", ())


class _JumpingSelector(selectors.DefaultSelector):
    """Waits for nothing: where there is nothing to read, the loop's clock jumps to its next timer."""

    loop: "JumpingLoop"

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        found = super().select(0)
        if not found:
            assert timeout is not None, "everybody waits, and nothing will ever happen"
            self.loop.now += timeout
        return found


class JumpingLoop(asyncio.SelectorEventLoop):
    """An event loop with a clock of its own, which begins at 0 s."""

    def __init__(self) -> None:
        self.now = 0.0
        selector = _JumpingSelector()
        selector.loop = self
        super().__init__(selector)

    def time(self) -> float:
        return self.now


def run(work: Coroutine[Any, Any, T]) -> T:
    """Runs a coroutine in a loop whose clock jumps."""
    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(work)


def plan(slug: str = "test", evaluators: Sequence[str] = ("track",), lockstep: float = 0.0, **more: Any) -> Plan:
    """A camera, evaluators and an application; ``lockstep`` is its limit of wall time in s, 0 for real time."""
    services = (
        PlannedService("environment", "camera", "virtual-camera", "x", ()),
        *(PlannedService("evaluation", name, "collision", "x", (), judge=True) for name in evaluators),
    )
    values: dict[str, Any] = {
        "name": slug, "slug": slug, "spec": f"{slug}/{slug}.dodo.yml", "description": "", "level": "sil",
        "kind": "closed-loop", "timeout_s": 10.0, "clock": "lockstep" if lockstep else "realtime",
        "isolation": "network", "seed": 7, "cid": 130, "subnet": "", "tag": "sil", "sandbox_image": "x",
        "services": services, "application": Application(".", (ApplicationService("app", ("app",)),)),
        "lockstep": Lockstep(1, lockstep) if lockstep else None,
    }  # fmt: skip
    return Plan(**{**values, **more})


@dataclass
class ScriptedBackend:
    """Reports ``stages``: a layer's events after its start, those of ``begin`` and ``close`` after these calls."""

    plan: Plan
    stages: Mapping[str, Events] = field(default_factory=dict)
    waits: Mapping[str, float] = field(default_factory=dict)
    """Seconds that ``open``, a layer's start or ``close`` takes."""
    problem: Exception | None = None
    """What ``open`` raises."""
    close_problem: Exception | None = None
    tails: Mapping[str, list[str]] = field(default_factory=dict)
    calls: list[str] = field(default_factory=list)
    name: str = "process"
    is_on_host: bool = False
    uses: Callable[[float], Snapshot | None] = lambda _: None
    """What was used at a time of the loop."""
    listens: Mapping[str, float] | None = None
    """When services of the application join the bus, by the loop's time; None where that cannot be seen."""
    printed: tuple[str, ...] = ()
    by_answers: bool = True

    def __post_init__(self) -> None:
        self.cid = self.plan.cid + 1
        self._events: asyncio.Queue[Event] = asyncio.Queue()

    async def open(self) -> None:
        await self._call("open")
        if self.problem:
            raise self.problem

    async def start(self, layer: str) -> dict[str, bool]:
        await self._call(layer)
        if layer == "application":
            return {s.name: False for s in self.plan.application.services}
        return {s.name: True for s in self.plan.layer(layer)}

    async def next_event(self) -> Event:
        return await self._events.get()

    async def listeners(self) -> Collection[str] | None:
        now = asyncio.get_running_loop().time()
        return None if self.listens is None else {name for name, since in self.listens.items() if since <= now}

    async def begin(self) -> None:
        await self._call("begin")

    async def use(self) -> Snapshot | None:
        return self.uses(asyncio.get_running_loop().time())

    async def application(self) -> Collection[int] | None:
        return [17]

    async def close(self, keep: bool) -> list[str]:
        await self._call("close")
        if self.close_problem:
            raise self.close_problem
        return ["look inside"] if keep else []

    def unmatched(self) -> tuple[str, ...]:
        return self.printed

    def tail(self, service: str) -> list[str]:
        return self.tails.get(service, [])

    async def _call(self, stage: str) -> None:
        loop = asyncio.get_running_loop()
        is_first = stage not in self.calls
        self.calls.append(stage)
        await asyncio.sleep(self.waits.get(stage, 0.0))
        events = self.stages.get(stage, ()) if is_first else ()
        for when in sorted({seconds for seconds, _ in events}):
            due = [event for seconds, event in events if seconds == when]
            loop.call_later(when, self._report, due) if when else self._report(due)

    def _report(self, events: Sequence[Event]) -> None:
        for event in events:
            self._events.put_nowait(event)


def drives(seconds: float = 5.0, verdict: VerdictEvent = PASSED) -> dict[str, Events]:
    """The stages of a test that ends with a verdict."""
    return {**READY, "begin": [(seconds, verdict), (seconds, Exited("track", 0))]}


def load(others: float, **services: tuple[float, float]) -> Callable[[float], Snapshot]:
    """Snapshots of two cores of which others take a share; services run and wait for shares of the time."""

    def at(now: float) -> Snapshot:
        busy = 2 * others + sum(ran for ran, _ in services.values())
        used = {name: Used(ran * now, waited * now) for name, (ran, waited) in services.items()}
        return Snapshot(now, used, 2, busy * now)

    return at


BUSY = load(0.8, app=(0.2, 0.3), camera=(0.2, 0.05))
"""A machine on which the application waits for three tenths of the time, as others have taken its cores."""


@dataclass
class ScriptedBackends:
    """Makes backends by ``make(plan, attempt)``, attempts counted from 1, and counts how many are open."""

    make: Callable[[Plan, int], ScriptedBackend] = lambda plan, _: ScriptedBackend(plan, drives())
    open_problem: BackendError | OSError | None = None
    leave_problem: Exception | None = None
    name: str = "process"
    began: list[str] = field(default_factory=list)
    now: int = 0

    async def prepare(self, plans: Sequence[Plan], note: Callable[[str], None]) -> None:
        note(f"prepared {len(plans)}")

    def close(self) -> None:
        pass

    @contextlib.asynccontextmanager
    async def open(self, job: Job, say: Callable[[str], None], keep: bool) -> AsyncIterator[Backend]:
        if self.open_problem:
            raise self.open_problem
        self.began.append(job.plan.slug)
        self.now += 1
        yield self.make(job.plan, self.began.count(job.plan.slug))
        self.now -= 1
        if self.leave_problem:
            raise self.leave_problem


async def one_by_one(*works: Coroutine[Any, Any, T]) -> list[asyncio.Future[T]]:
    """Begins works a twentieth of a second apart."""
    begun = []
    for work in works:
        begun.append(asyncio.ensure_future(work))
        await asyncio.sleep(0.05)
    return begun


def jobs(folder: Path, *plans: Plan) -> list[Job]:
    return [Job(plan, folder / "compiled", folder / "report" / plan.slug) for plan in plans]


def send_signal_after(seconds: float, number: int) -> None:
    """A signal to this very process, in which only the running loop handles it."""
    asyncio.get_running_loop().call_later(seconds, os.kill, os.getpid(), number)
