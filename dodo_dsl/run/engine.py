"""One test from set-up to outcome, whatever backend it runs on."""

import asyncio
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.clock_service import CLOCK
from dodo_dsl.plan.model import READY_S, Plan
from dodo_dsl.run.protocol import Backend, BackendError, Event, Noted, Overrun
from dodo_dsl.run.test_state import Ended, Hearing

ORDER = ("environment", "action", "evaluation", "application")
READY_PATIENCE_S = READY_S
LAST_TIME_PATIENCE_S = 2.0
BEGIN_PATIENCE_S = 2.0


@dataclass
class Engine:
    """Drives one backend through one Plan. ``say`` is told each phase, for live progress."""

    plan: Plan
    backend: Backend
    say: Callable[[str], None]
    heard: Hearing = field(init=False)
    _told_to_begin: float = 0.0

    def __post_init__(self) -> None:
        self.heard = Hearing(self.plan)

    async def run(self, keep: bool = False) -> tuple[Outcome, list[str]]:
        """The outcome, and what to say of a test that is kept up. Cancelling gives the outcome error, too."""
        kept: list[str] = []
        try:
            await self._set_up()
            await self._execute()
        except Ended:
            pass
        except BackendError as error:
            self.heard.find("error", str(error))
        except asyncio.CancelledError:
            self.heard.find("error", "the run was interrupted")
            asyncio.current_task().uncancel()  # type: ignore[union-attr]
        finally:
            self.heard.finished = self.heard.finished or time.monotonic()
            self.say("taking down")
            kept = await self._closed(keep)
            await self._hear_losses()
        return self.heard.outcome(self.backend), kept

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
        self.heard.notes.append(f"not all of the test was taken down: {type(error).__name__}: {error}")
        return []

    async def _hear_losses(self) -> None:
        """What was said of losses while services ended; what else they said then no longer counts."""
        while (event := await self._next(0.0)) is not None:
            if isinstance(event, Overrun | Noted):
                self.heard.take(event)

    async def _set_up(self) -> None:
        start = time.monotonic()
        self.say("setting up")
        await self.backend.open()
        for layer in ORDER:
            names = await self.backend.start(layer)
            self.heard.layer_of.update(dict.fromkeys(names, layer))
            self.say(f"waiting for {layer}")
            await self._until_ready({name for name, says in names.items() if says})
        self.heard.setup_s = time.monotonic() - start

    async def _until_ready(self, waits: set[str]) -> None:
        """Waits for those that say when they are ready; the others are when they run."""
        begin = time.monotonic()
        patience = dict.fromkeys(waits, READY_PATIENCE_S)
        patience |= {s.name: READY_PATIENCE_S + s.setup_s for s in self.plan.services if s.name in waits}
        while left := waits - self.heard.ready:
            late = min(left, key=lambda name: (patience[name], name))
            event = await self._next(begin + patience[late])
            if event is None:
                self.heard.end("error", f"service '{late}' was not ready within {patience[late]:g} s", late)
            else:
                self.heard.take(event)

    async def _next(self, deadline: float) -> Event | None:
        try:
            async with asyncio.timeout(max(0.0, deadline - time.monotonic())):
                return await self.backend.next_event()
        except TimeoutError:
            return None

    async def _execute(self) -> None:
        began = self.heard.began = time.monotonic()
        await self._begin()
        self.say("running")
        lockstep = self.plan.lockstep
        deadline = began + (lockstep.wall_timeout_s if lockstep else self.plan.timeout_s)
        while not self.heard.all_judged():
            event = await self._next(min(deadline, self._begin_again()))
            if event is not None:
                self.heard.take(event)
            elif time.monotonic() < deadline:
                await self._begin()
            elif lockstep:
                self._give_up(lockstep.wall_timeout_s)
            else:
                self.heard.time_out()
        self.heard.finished = time.monotonic()
        if lockstep:
            await self._last_time()

    async def _begin(self) -> None:
        await self.backend.begin()
        self._told_to_begin = time.monotonic()

    def _begin_again(self) -> float:
        """When to say again that the test begins: the clock of a lockstep test says so once it has heard that."""
        waits = self.plan.lockstep is not None and self.heard.time is None
        return self._told_to_begin + BEGIN_PATIENCE_S if waits else math.inf

    async def _last_time(self) -> None:
        """How far the clock got, which it says when the last evaluator has ended."""
        deadline = time.monotonic() + LAST_TIME_PATIENCE_S
        while not (self.heard.time and self.heard.time.last) and CLOCK not in self.heard.exits:
            event = await self._next(deadline)
            if event is None:
                return
            self.heard.take(event)

    def _give_up(self, wall_timeout_s: float) -> None:
        got = f" and got to {self.heard.time.seconds:.1f} s of its own" if self.heard.time else ""
        self.heard.end("error", f"the test took more than {wall_timeout_s:g} s of wall time{got}", CLOCK)
