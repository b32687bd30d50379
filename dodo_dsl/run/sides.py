"""One test on a backend: DoDo's services on one side, the application's on the other, or all of them on the same."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Collection, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Protocol

import msgspec

from dodo_dsl.application.ros_topics import BRIDGE
from dodo_dsl.plan.model import ApplicationService, Plan, PlannedService
from dodo_dsl.run.announce import begin
from dodo_dsl.run.machine_load.service_use import Snapshot
from dodo_dsl.run.outcomes import unstartable
from dodo_dsl.run.printed_lines import PrintedLines, Send
from dodo_dsl.run.protocol import Event, Exited, Finding, GraphFinding, Noted, Rested
from dodo_dsl.run.service_output import ServiceOutput
from dodo_dsl.run.service_protocol import Reports
from dodo_dsl.run.start_order import Conditions, one_off, optional

APPLICATION = "application"
"""The layer that is not DoDo's."""


class WatchedServices:
    """What becomes of a test's services, on whichever side they run: events, output, and who waits for whom."""

    def __init__(self, plan: Plan, folder: Path, report: Path) -> None:
        """``folder`` is the compiled test's, ``report`` takes logs."""
        self.plan, self.folder, self.report = plan, folder, report
        self.events: asyncio.Queue[Event] = asyncio.Queue()
        self.lines = PrintedLines(plan, folder, self.note)
        self.outputs: dict[str, ServiceOutput] = {}
        self.reports = Reports(plan, report / "logs", self.tell, self.outputs)
        self.conditions = Conditions(plan.application.services)
        self.may_be_ill = one_off(plan.application.services) | optional(plan.application.services)
        self.turns: set[asyncio.Task[None]] = set()
        """The services of the application that wait for others."""
        self.by_answers = False
        """Whether the application keeps the machine's time in lockstep, so that it is awaited by its answers."""

    def of(self, layer: str) -> tuple[PlannedService | ApplicationService, ...]:
        """The services of a layer."""
        return self.plan.application.services if layer == APPLICATION else self.plan.layer(layer)

    def tell(self, event: Event) -> None:
        if isinstance(event, Rested):
            self._reading = asyncio.ensure_future(self._read_lines(event.time))
        else:
            self.events.put_nowait(event)

    async def _read_lines(self, now: int) -> None:
        """Reads what services have printed that rest now (us), and answers the clock."""
        names = [name for name in self.lines.services if name in self.outputs]
        goes_on = await asyncio.gather(*(self._read_empty(name) for name in names))
        self.lines.rest(now, any(goes_on))

    async def _read_empty(self, name: str) -> bool:
        try:
            return await self.outputs[name].read_empty()
        except TimeoutError:
            self.outputs[name].type_in = None
            why = "its terminal does not say what was printed until when, as it repeats nothing"
            self.note(f"a line of '{name}' may count for a later step than the one in which it was printed: {why}")
            return False

    def note(self, text: str) -> None:
        self.tell(Noted(text))

    def lose(self, why: str) -> None:
        """A side is gone, with what ran there."""
        self.tell(Finding("error", why))

    def await_answers(self, why: str) -> None:
        """In lockstep the application cannot have the test's time."""
        self.by_answers = True
        self.note(f"lockstep by answers: {why}; timers and threads of the application may make its results differ")

    def not_started(self, name: str, why: str) -> None:
        self.tell(unstartable(self.plan, name, why))
        self.conditions.failed(name)

    def ended(self, name: str, code: int, out_of_memory: bool) -> None:
        self.tell(Exited(name, code, out_of_memory))
        self.conditions.ended(name, code)

    async def start(
        self,
        names: Collection[str],
        start: Callable[[str], Awaitable[None]],
        reports: Iterable[str],
    ) -> dict[str, bool]:
        """Starts services, those of the application when what they wait for is so; who will report to be ready.

        Those do that wait, and those in ``reports``.
        """

        async def when_met(name: str) -> None:
            try:
                if why := await self.conditions.unmet(name, self.note):
                    self.not_started(name, why)
                else:
                    await start(name)
            except Exception as error:  # noqa: BLE001  (nobody awaits it)
                self.not_started(name, f"{type(error).__name__}: {error}")

        waiting = [name for name in names if self.conditions.of(name)]
        await asyncio.gather(*(start(name) for name in names if name not in waiting))
        self.turns |= {asyncio.ensure_future(when_met(name)) for name in waiting}
        ready = {*waiting, *reports} - self.may_be_ill
        return {name: name in ready for name in names}

    def prints(self, name: str) -> bool:
        """Whether what a service prints becomes messages."""
        return name in self.lines.services

    def output(self, layer: str, name: str, take: Callable[[bytes], bool] | None = None, **kind: bool) -> ServiceOutput:
        """Where a service that is started writes; raises OSError for a terminal.

        ``take`` gets its lines instead, and ``kind`` is as for ``ServiceOutput``.
        """

        def on_line(line: bytes) -> bool:
            if name == BRIDGE:
                return self._take_finding(line)
            return layer != APPLICATION and self.reports.take_line(name, line)

        log = self.report / "logs" / f"{layer}.{name}.log"
        match = partial(self.lines.match, name) if self.prints(name) else None
        self.outputs[name] = ServiceOutput(log, take or on_line, match=match, **kind)
        return self.outputs[name]

    def _take_finding(self, line: bytes) -> bool:
        """Whether a line of the bridge's is about the application's ROS graph."""
        try:
            self.tell(msgspec.json.decode(line, type=GraphFinding))
        except msgspec.MsgspecError:
            return False
        return True

    async def last_output(self, name: str, patience_s: float) -> None:
        """Returns when all is read that a service said and wrote, so that no verdict follows its end."""
        if name in self.outputs:
            with contextlib.suppress(TimeoutError):  # a child of the service may still hold its output open
                await asyncio.wait_for(self.outputs[name].done.wait(), patience_s)
        await self.reports.ended(name)

    def tail(self, service: str) -> list[str]:
        return self.outputs[service].tail() if service in self.outputs else []

    def close(self) -> None:
        """Reads what is there of what services said and wrote, and no more."""
        self.reports.close()
        self.lines.close()
        for output in self.outputs.values():
            output.close()


class Side(Protocol):
    """Processes or containers of one test. It reports by events, but raises BackendError where it says so."""

    async def open(self, entered: int = 0) -> int:
        """In the network, IPC namespace and ``/tmp`` of a process; returns the one whose the other side shares.

        0 stands for own namespaces, or the host's. Raises BackendError.
        """

    async def connect(self) -> Send:
        """What sends to DoDo's services, which this side has, and on the bus; raises BackendError."""

    async def start(self, layer: str) -> dict[str, bool]:
        """Starts the services of a layer; returns their names, and whether each will report that it is ready."""

    async def listeners(self) -> Collection[str] | None:
        """The services of the application that listen on an OpenDLV bus already; None if that cannot be seen."""

    async def use(self) -> Snapshot | None:
        """What the services used so far; None if that cannot be measured."""

    async def application(self) -> Collection[int] | None:
        """Processes of this machine of which the application's are, or descend; None if they are not known."""

    async def close(self, keep: bool) -> list[str]:
        """Ends everything and cleans up; with ``keep``, leaves it and returns sentences on how to look inside."""


class Backend:
    """Where all services of one test run; ``own`` is DoDo's side, which may be the ``application``'s, too.

    On the host the application has the machine's own ``/tmp``, shared memory and IPC.
    """

    def __init__(
        self, name: str, cid: int, is_on_host: bool, watched: WatchedServices, own: Side, application: Side
    ) -> None:
        self.name, self.cid, self.is_on_host = name, cid, is_on_host
        self._watched, self._own, self._application = watched, own, application
        self._send: Send | None = None
        self._sides = (own,) if own is application else (own, application)
        self.tail, self.next_event, self.unmatched = watched.tail, watched.events.get, watched.lines.unmatched
        self.listeners, self.application = application.listeners, application.application

    async def open(self) -> None:
        process = await self._application.open()
        if self._own is not self._application:
            await self._own.open(process)

    async def start(self, layer: str) -> dict[str, bool]:
        if layer != APPLICATION:
            return await self._own.start(layer)
        self._send = await self._own.connect()
        self._watched.reports.stop_listening()
        self._watched.lines.connect(self._send)
        return await self._application.start(layer)

    @property
    def by_answers(self) -> bool:
        """Whether the application keeps the machine's time in lockstep."""
        return self._watched.by_answers

    async def begin(self) -> None:
        """Announces on the test's bus that everything is ready; may be repeated."""
        assert self._send is not None, "the application was started"
        self._send(*begin(self._watched.plan))

    async def use(self) -> Snapshot | None:
        """What all have used; the load of the machine is measured if both sides know it."""
        taken = await asyncio.gather(*(side.use() for side in self._sides))
        own, application = taken[0], taken[-1]
        if own is None or application is None:
            return application and replace(application, busy_s=None)
        busy_s = None if application.busy_s is None else own.busy_s
        return replace(own, services={**own.services, **application.services}, busy_s=busy_s)

    async def close(self, keep: bool) -> list[str]:
        for turn in self._watched.turns:
            turn.cancel()
        await asyncio.gather(*self._watched.turns, return_exceptions=True)
        try:
            kept = await asyncio.gather(*(side.close(keep) for side in self._sides), return_exceptions=True)
        finally:
            self._watched.close()
        if errors := [each for each in kept if isinstance(each, BaseException)]:
            raise errors[0]
        return [line for each in kept if isinstance(each, list) for line in each]
