"""The order in which services of the application start: by the conditions of their ``depends_on``."""

import asyncio
from collections.abc import Callable, Coroutine, Iterable, Mapping
from typing import Any

from dodo_dsl.plan.model import COMPLETED, HEALTHY, STARTED, ApplicationService
from dodo_dsl.run.outcomes import how_it_ended

LONGEST_S = 600.0
"""The longest that a service waits for a condition to come true, in s, once the other one has started."""
_ASKED = {STARTED: "start", HEALTHY: "be healthy", COMPLETED: "end with exit code 0"}
_UNHEALTHY = "is unhealthy"


class Conditions:
    """What became of an application's services, for those that wait for it; belongs to one event loop."""

    def __init__(self, services: Iterable[ApplicationService]) -> None:
        services = tuple(services)
        self._after = {s.name: s.after for s in services}
        self._optional = {s.name: s.optional for s in services}
        self._known: dict[tuple[str, str], asyncio.Future[str]] = {}

    def of(self, name: str) -> Mapping[str, str]:
        return self._after.get(name, {})

    def started(self, name: str) -> None:
        self._decide(name, STARTED, "")

    def healthy(self, name: str) -> None:
        self._decide(name, HEALTHY, "")

    def unhealthy(self, name: str) -> None:
        self._decide(name, HEALTHY, _UNHEALTHY)

    def ended(self, name: str, code: int) -> None:
        self._decide(name, HEALTHY, how_it_ended(code))
        self._decide(name, COMPLETED, how_it_ended(code) if code else "")

    def failed(self, name: str) -> None:
        for condition in _ASKED:
            self._decide(name, condition, "could not be started")

    async def unmet(self, name: str, note: Callable[[str], None]) -> str:
        """Waits until a service may start; why it never may, in a sentence, else empty.

        ``note`` gets a sentence for each optional service without which it starts.
        """
        for other, asked in self.of(name).items():
            why = await self._fact(other, STARTED)
            try:
                async with asyncio.timeout(LONGEST_S):
                    why = why or await self._fact(other, asked)
                why = why and f"which {why}"
            except TimeoutError:
                why = f"and it did not within {LONGEST_S:g} s"
            if why and other not in self._optional[name]:
                return f"it waits for '{other}' to {_ASKED[asked]} (depends_on), {why}"
            if why:
                key = "depends_on, required: false"
                note(f"service '{name}' starts all the same: it waits for '{other}' to {_ASKED[asked]} ({key}), {why}")
        return ""

    async def ill(self, name: str) -> str:
        """Waits until a service that has started is healthy, or has ended; why it is neither, else empty."""
        try:
            async with asyncio.timeout(LONGEST_S):
                why = await self._fact(name, HEALTHY)
        except TimeoutError:
            return f"its healthcheck did not succeed within {LONGEST_S:g} s"
        return "its healthcheck failed" if why == _UNHEALTHY else ""

    def _fact(self, name: str, condition: str) -> "asyncio.Future[str]":
        """Resolves to why the condition will not come true, empty when it has; not to be cancelled by waiters."""
        return asyncio.shield(self._future(name, condition))

    def _future(self, name: str, condition: str) -> "asyncio.Future[str]":
        key = name, condition
        if key not in self._known:
            self._known[key] = asyncio.get_running_loop().create_future()
        return self._known[key]

    def _decide(self, name: str, condition: str, why: str) -> None:
        future = self._future(name, condition)
        if not future.done():
            future.set_result(why)


def in_turn(start: Coroutine[Any, Any, None], failed: Callable[[str], None]) -> "asyncio.Task[None]":
    """Starts a service in its own task; ``failed`` gets what its exception says, because nobody awaits the task."""

    def ended(task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            failed(f"{type(error).__name__}: {error}")

    task = asyncio.ensure_future(start)
    task.add_done_callback(ended)
    return task


def one_off(services: Iterable[ApplicationService]) -> set[str]:
    """The services that may end, as others start when they have."""
    return {n for s in services for n, condition in s.after.items() if condition == COMPLETED}


def may_end(services: Iterable[ApplicationService], name: str, code: int) -> bool:
    """Whether the end of a service is not a failure of the application."""
    services = tuple(services)
    return name in one_off(services) and (code == 0 or name in optional(services))


def optional(services: Iterable[ApplicationService]) -> set[str]:
    """The services whose health or end others wait for, and without which all of these start, too."""
    services = tuple(services)
    found = [(n, n in s.optional) for s in services for n, condition in s.after.items() if condition != STARTED]
    return {n for n, _ in found} - {n for n, is_optional in found if not is_optional}
