"""One test from set-up to outcome, whatever backend it runs on."""

import asyncio
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.lockstep import CLOCK
from dodo_dsl.plan.model import LAYERS, READY_S, Plan
from dodo_dsl.run.events import (
    Backend,
    BackendError,
    Event,
    Exited,
    Lost,
    Malformed,
    Noted,
    Overrun,
    Ready,
    Stopped,
    Time,
    Unstartable,
    Verdict,
)
from dodo_dsl.run.outcome import Facts, Finding, decide, how_it_ended, lost_messages

ORDER = ("environment", "action", "evaluation", "application")
READY_PATIENCE_S = READY_S
LAST_TIME_PATIENCE_S = 2.0
BEGIN_PATIENCE_S = 2.0


class _Ended(Exception):
    """The test is over; what decided it stands in the facts."""


@dataclass
class Engine:
    """Drives one backend through one Plan. ``say`` is told each phase, for live progress."""

    plan: Plan
    backend: Backend
    say: Callable[[str], None]
    facts: Facts = field(init=False)
    layer_of: dict[str, str] = field(default_factory=dict)
    exits: dict[str, int] = field(default_factory=dict)
    ready: set[str] = field(default_factory=set)
    lost: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    began: float | None = None
    finished: float | None = None
    setup_s: float | None = None
    time: Time | None = None
    _told_to_begin: float = 0.0

    def __post_init__(self) -> None:
        self.facts = Facts(tuple(s.name for s in self.plan.services if s.judge))

    async def run(self, keep: bool = False) -> tuple[Outcome, list[str]]:
        """The outcome, and what to say of a test that is kept up. Cancelling gives the outcome error, too."""
        kept: list[str] = []
        start = time.monotonic()
        try:
            await self._set_up(start)
            await self._execute()
        except _Ended:
            pass
        except BackendError as error:
            self._find("error", str(error))
        except asyncio.CancelledError:
            self._find("error", "the run was interrupted")
            asyncio.current_task().uncancel()  # type: ignore[union-attr]
        finally:
            self.finished = self.finished or time.monotonic()
            self.say("taking down")
            kept = await self._closed(keep)
            await self._hear_losses()
        return self._outcome(), kept

    async def _closed(self, keep: bool) -> list[str]:
        """Teardown to its end, however often the run is interrupted meanwhile; its faults are no verdict."""
        closing = asyncio.ensure_future(self.backend.close(keep))
        while not closing.done():
            try:
                await asyncio.wait([closing])
            except asyncio.CancelledError:
                asyncio.current_task().uncancel()  # type: ignore[union-attr]
        if (error := closing.exception()) is None:
            return closing.result()
        self.notes.append(f"not all of the test was taken down: {type(error).__name__}: {error}")
        return []

    async def _hear_losses(self) -> None:
        """What was said of losses while services ended; what else they said then no longer counts."""
        while (event := await self._next(0.0)) is not None:
            if isinstance(event, Overrun | Noted):
                self._take(event)

    async def _set_up(self, start: float) -> None:
        self.say("setting up")
        await self.backend.open()
        for layer in ORDER:
            names = await self.backend.start(layer)
            self.layer_of.update(dict.fromkeys(names, layer))
            self.say(f"waiting for {layer}")
            await self._until_ready({name for name, says in names.items() if says})
        self.setup_s = time.monotonic() - start

    async def _until_ready(self, waits: set[str]) -> None:
        """Waits for those that say when they are ready; the others are when they run."""
        begin = time.monotonic()
        patience = dict.fromkeys(waits, READY_PATIENCE_S)
        patience |= {s.name: READY_PATIENCE_S + s.setup_s for s in self.plan.services if s.name in waits}
        while left := waits - self.ready:
            late = min(left, key=lambda name: (patience[name], name))
            event = await self._next(begin + patience[late])
            if event is None:
                self._end("error", f"service '{late}' was not ready within {patience[late]:g} s", late)
            else:
                self._take(event)

    async def _next(self, deadline: float) -> Event | None:
        try:
            async with asyncio.timeout(max(0.0, deadline - time.monotonic())):
                return await self.backend.next_event()
        except TimeoutError:
            return None

    async def _execute(self) -> None:
        self.began = time.monotonic()
        await self.backend.begin()
        self._told_to_begin = time.monotonic()
        self.say("running")
        lockstep = self.plan.lockstep
        deadline = self.began + (lockstep.wall_timeout_s if lockstep else self.plan.timeout_s)
        while not self._all_judged():
            event = await self._next(min(deadline, self._begin_again()))
            if event is not None:
                self._take(event)
            elif time.monotonic() < deadline:
                await self.backend.begin()
                self._told_to_begin = time.monotonic()
            elif lockstep:
                self._give_up(lockstep.wall_timeout_s)
            else:
                self._time_out()
        self.finished = time.monotonic()
        if lockstep:
            await self._last_time()

    def _begin_again(self) -> float:
        """When to say again that the test begins: the clock of a lockstep test says so once it has heard that."""
        waits = self.plan.lockstep is not None and self.time is None
        return self._told_to_begin + BEGIN_PATIENCE_S if waits else math.inf

    async def _last_time(self) -> None:
        """How far the clock got, which it says when the last evaluator has ended."""
        deadline = time.monotonic() + LAST_TIME_PATIENCE_S
        while not (self.time and self.time.last) and CLOCK not in self.exits:
            event = await self._next(deadline)
            if event is None:
                return
            self._take(event)

    def _give_up(self, wall_timeout_s: float) -> None:
        got = f" and got to {self.time.seconds:.1f} s of its own" if self.time else ""
        self._end("error", f"the test took more than {wall_timeout_s:g} s of wall time{got}", CLOCK)

    def _all_judged(self) -> bool:
        return all(judge in self.exits for judge in self.facts.judges)

    def _time_out(self) -> None:
        late = next(judge for judge in self.facts.judges if judge not in self.exits)
        self._end(
            "error",
            f"evaluator '{late}' gave no verdict within the timeout of {self.plan.timeout_s:g} s",
            late,
        )

    def _take(self, event: Event) -> None:
        match event:
            case Ready(service):
                self.ready.add(service)
            case Verdict(service) if self.began is None:
                self._end("error", f"evaluator '{service}' gave a verdict before the test began", service)
            case Verdict(service):
                self.facts.verdicts.setdefault(service, []).append(event)
            case Malformed(service, problem):
                self._end("error", f"the verdict of evaluator '{service}' is malformed: {problem}", service)
            case Overrun(service, messages):
                self.lost[service] = messages
            case Noted(text):
                self.notes.append(text)
            case Unstartable(service, why):
                self._end("error", f"service '{service}' could not be started: {why}", service)
            case Lost(why):
                self._end("error", why)
            case Time():
                self.time = event
            case Stopped(kind, reason):
                self._take_stop(kind, reason)
            case Exited(service, code, out_of_memory):
                self.exits[service] = code
                self._take_exit(service, code, out_of_memory)

    def _take_stop(self, kind: str, reason: str) -> None:
        if kind == "timedout":
            self._time_out()
        is_silent = kind == "unanswered"
        self._end("failed" if is_silent else "error", reason, self._who_answers() if is_silent else CLOCK)

    def _take_exit(self, service: str, code: int, out_of_memory: bool) -> None:
        layer, when = self.layer_of.get(service, "application"), self._when()
        ended = f"{'ran out of memory' if out_of_memory else how_it_ended(code)} {when}"
        if layer == "application":
            if not self._all_given():
                self._end("failed", f"application service '{service}' {ended}, before the test was decided", service)
        elif code != 0:
            self._end("error", f"service '{service}' of layer {layer} {ended}", service)
        elif service not in self.ready and self.began is None:
            self._end("error", f"service '{service}' of layer {layer} {ended}, before it was ready", service)
        elif service in self.facts.judges and not self.facts.verdicts.get(service):
            self._end("error", f"evaluator '{service}' ended without a verdict {when}", service)

    def _all_given(self) -> bool:
        return all(self.facts.verdicts.get(judge) for judge in self.facts.judges)

    def _when(self) -> str:
        if self.began is None:
            return "during set-up"
        return f"after {time.monotonic() - self.began:.1f} s"

    def _who_answers(self) -> str:
        """The application's service whose last lines may tell why there is no answer."""
        return next((s.name for s in self.plan.application.services), "")

    def _find(self, result: Any, reason: str, service: str = "") -> None:
        self.facts.findings.append(Finding(result, reason, service))

    def _end(self, result: Any, reason: str, service: str = "") -> None:
        self._find(result, reason, service)
        raise _Ended

    def _outcome(self) -> Outcome:
        plan, finding = self.plan, decide(self.facts)
        checks = [
            check for judge in self.facts.judges for v in self.facts.verdicts.get(judge, []) for check in v.checks
        ]
        return Outcome(
            name=plan.name,
            slug=plan.slug,
            spec=plan.spec,
            level=plan.level,
            kind=plan.kind,
            outcome=finding.result,
            reason=finding.reason,
            cid=self.backend.cid,
            seed=plan.seed,
            clock=plan.clock,
            backend=self.backend.name,
            setup_s=self.setup_s,
            execution_s=self.finished - self.began if self.finished and self.began else None,
            sim_s=self.time.seconds if self.time else None,
            services=tuple(self._service_rows()),
            checks=tuple(checks),
            last_lines=tuple(self.backend.tail(finding.service)) if finding.result != "passed" else (),
            notes=(*self.notes, *(lost_messages(s, self.lost[s.name]) for s in plan.services if s.name in self.lost)),
        )

    def _service_rows(self) -> list[dict[str, Any]]:
        uses = {s.name: s.uses for s in self.plan.services}
        return [
            {"name": name, "layer": layer, "uses": uses.get(name), "exit_code": self.exits.get(name)}
            for name, layer in sorted(self.layer_of.items(), key=lambda item: (LAYERS.index(item[1]), item[0]))
        ]
