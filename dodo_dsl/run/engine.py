"""One test from set-up to outcome, whatever backend it runs on."""

import asyncio
import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass, field

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.added_services import CLOCK
from dodo_dsl.plan.model import LAYERS, READY_S, Plan
from dodo_dsl.run import listeners
from dodo_dsl.run.machine_load.meter import Meter
from dodo_dsl.run.protocol import (
    BackendError,
    Event,
    Exited,
    Foreign,
    GraphFinding,
    Late,
    Noted,
    Overrun,
    Paused,
    Time,
)
from dodo_dsl.run.run_state import Ended, RunState
from dodo_dsl.run.sides import Backend

READY_PATIENCE_S = READY_S
LAST_TIME_PATIENCE_S = 2.0
BEGIN_PATIENCE_S = 2.0
EXPLAIN_PATIENCE_S = 5.0
LISTEN_PATIENCE_S, LISTEN_PERIOD_S = 10.0, 0.02


@dataclass
class Engine:
    """Drives one backend through one Plan. ``say`` is called with each phase, for live progress.

    ``passed`` is called before a test is taken down that has passed.

    All times are of the running event loop's clock, in s.
    """

    plan: Plan
    backend: Backend
    say: Callable[[str], None]
    passed: Callable[[], None] = lambda: None
    state: RunState = field(init=False)
    _now: Callable[[], float] = field(init=False)
    _meter: Meter = field(init=False)
    _begin_sent: float = 0.0

    async def run(self, keep: bool = False) -> tuple[Outcome, list[str]]:
        """The outcome, and sentences about a test that is kept up. Cancelling gives the outcome error, too."""
        self._now = asyncio.get_running_loop().time
        self.state = RunState(self.plan, self._now)
        self._meter = Meter(self.backend.use, self.state.test_s, self.state.is_application)
        kept: list[str] = []
        try:
            await self._set_up()
            self._meter.begin()
            await self._execute()
        except Ended:
            pass
        except BackendError as error:
            self.state.add_finding("error", str(error))
        except asyncio.CancelledError:
            self.state.add_finding("error", "the run was interrupted")
            asyncio.current_task().uncancel()  # type: ignore[union-attr]
        finally:
            if self.state.finished is None:
                self.state.finished = self._now()
            self.state.keep_tails(self.backend)
            kept = await self._close(keep)
            await self._collect_losses()
        return self.state.outcome(self.backend), kept

    async def _look_for_buses(self) -> None:
        """Reports to the state on which buses an application is of which nothing came."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(EXPLAIN_PATIENCE_S):
                self.state.buses = frozenset(listeners.buses(await self.backend.application() or ()))

    async def _close(self, keep: bool) -> list[str]:
        """Teardown to its end, however often the run is interrupted meanwhile; its errors do not change the verdict."""
        closing = asyncio.ensure_future(self._wind_up(keep))
        while not closing.done():
            try:
                await asyncio.wait([closing])
            except asyncio.CancelledError:
                asyncio.current_task().uncancel()  # type: ignore[union-attr]
        if (error := closing.exception()) is None:
            return closing.result()
        self.state.notes.append(f"not all of the test was taken down: {type(error).__name__}: {error}")
        return []

    async def _measure(self) -> None:
        """Takes the last figures of load and use, while the application is there."""
        try:
            await self._meter.end()
        except Exception as error:  # noqa: BLE001  (whatever it is, it must not decide the test)
            why = f"{type(error).__name__}: {error}"
            self.state.notes.append(f"load and use of the machine were not measured to the end: {why}")
        names = [service.name for service in self.plan.application.services]
        self.state.resources = self._meter.figures(names)
        self.state.load = self._meter.load()

    async def _wind_up(self, keep: bool) -> list[str]:
        await self._measure()
        try:
            if self.state.finding.silent and not self.backend.is_on_host:
                await self._look_for_buses()
            if not keep and self.state.outcome(self.backend).outcome == "passed":
                self.passed()
        finally:
            self.say("taking down")
            kept = await self.backend.close(keep)
        return kept

    async def _collect_losses(self) -> None:
        """Losses, lateness, notes, ends and the clock's time as reported in teardown; other events do not count then.

        But for what the application must not send: only when all is read is it known that nothing was.
        """
        while (event := await self._next(0.0)) is not None:
            if isinstance(event, Foreign):
                self.state.add_finding("failed", event.reason)
            if isinstance(event, Exited):
                self.state.note_end(event, is_asked=True)
            if isinstance(event, Overrun | Late | Paused | Noted | Time | GraphFinding):
                self.state.take(event)

    async def _set_up(self) -> None:
        start = self._now()
        self.say("setting up")
        await self.backend.open()
        for layer in LAYERS:
            names = await self.backend.start(layer)
            self.state.layer_of.update(dict.fromkeys(names, layer))
            self.say(f"waiting for {layer}")
            await self._until_ready({name for name, reports_ready in names.items() if reports_ready})
        await self._until_listening()
        self.state.setup_s = self._now() - start

    async def _until_listening(self) -> None:
        """Waits for the application's services that consume messages: what comes before they listen is lost.

        Where its time is the test's, it goes on only in the test: then this waits until it rests.
        """
        waits = {s.name for s in self.plan.application.services if s.inputs}
        deadline = self._now() + LISTEN_PATIENCE_S
        if self.plan.lockstep and not self.backend.by_answers:
            while not self.state.has_started:
                if event := await self._next(math.inf):
                    self.state.take(event)
            return
        while waits and (listeners := await self.backend.listeners()) is not None and (waits := waits - {*listeners}):
            if self._now() >= deadline:
                deaf = f"not joined the bus after {LISTEN_PATIENCE_S:g} s: what others sent before is lost"
                self.state.notes += [f"'{name}', which consumes messages, had {deaf}" for name in sorted(waits)]
                return
            if event := await self._next(self._now() + LISTEN_PERIOD_S):
                self.state.take(event)

    async def _until_ready(self, waits: set[str]) -> None:
        """Waits for services that report when they are ready; the others are ready when they run."""
        begin = self._now()
        patience = dict.fromkeys(waits, READY_PATIENCE_S)
        patience |= {s.name: READY_PATIENCE_S + s.setup_s for s in self.plan.services if s.name in waits}
        patience |= {s.name: math.inf for s in self.plan.application.services if s.after}  # as conditions end
        while left := waits - self.state.ready:
            late = min(left, key=lambda name: (patience[name], name))
            event = await self._next(begin + patience[late])
            if event is None:
                self.state.end("error", f"service '{late}' was not ready within {patience[late]:g} s", late)
            else:
                self.state.take(event)

    async def _next(self, deadline: float) -> Event | None:
        try:
            async with asyncio.timeout(max(0.0, deadline - self._now())):
                return await self.backend.next_event()
        except TimeoutError:
            return None

    async def _execute(self) -> None:
        began = self.state.began = self._now()
        await self._begin()
        self.say("running in lockstep by answers" if self.plan.lockstep and self.backend.by_answers else "running")
        lockstep = self.plan.lockstep
        deadline = began + (lockstep.wall_timeout_s if lockstep else self.plan.timeout_s)
        while not self.state.all_evaluators_ended():
            event = await self._next(min(deadline, self._next_begin()))
            if event is not None:
                self.state.take(event)
            elif self._now() < deadline:
                await self._begin()
            elif lockstep:
                self._give_up(lockstep.wall_timeout_s)
            else:
                self.state.time_out()
        self.state.finished = self._now()
        if lockstep:
            await self._await_last_time()

    async def _begin(self) -> None:
        await self.backend.begin()
        self._begin_sent = self._now()

    def _next_begin(self) -> float:
        """When to announce the start of the test again: until the clock of a lockstep test reports a time."""
        waits = self.plan.lockstep is not None and self.state.time is None
        return self._begin_sent + BEGIN_PATIENCE_S if waits else math.inf

    async def _await_last_time(self) -> None:
        """How far the clock got, which it reports when the last evaluator has ended."""
        deadline = self._now() + LAST_TIME_PATIENCE_S
        while not (self.state.time and self.state.time.last) and CLOCK not in self.state.exits:
            event = await self._next(deadline)
            if event is None:
                return
            self.state.take(event)

    def _give_up(self, wall_timeout_s: float) -> None:
        reached = f" and reached {self.state.time.seconds:.1f} s of test time" if self.state.time else ""
        self.state.end("error", f"the test took more than {wall_timeout_s:g} s of wall time{reached}", CLOCK)
