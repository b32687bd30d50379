"""The order in which services of the application start: by the conditions of their ``depends_on``."""

import asyncio
from collections.abc import Iterable, Mapping

from dodo_dsl.plan.model import COMPLETED, HEALTHY, STARTED, ApplicationService
from dodo_dsl.run.outcomes import how_it_ended

LONGEST_S = 600.0
"""The longest that a service waits for another one to come true, in s, once that has started."""
_ASKED = {STARTED: "start", HEALTHY: "be healthy", COMPLETED: "end with exit code 0"}


class Conditions:
    """What became of an application's services, for those that wait for it; belongs to one event loop.

    ``has_health`` tells that there are health checks; without, a service that has started counts as healthy.
    """

    def __init__(self, services: Iterable[ApplicationService], has_health: bool = True) -> None:
        self._after = {s.name: {n: _without_health(c, has_health) for n, c in s.after.items()} for s in services}
        self._known: dict[tuple[str, str], asyncio.Future[str]] = {}

    def of(self, name: str) -> Mapping[str, str]:
        """The services for which one waits, each with its condition."""
        return self._after.get(name, {})

    def waits_for_ends(self, name: str) -> bool:
        """Whether a service starts only after another one has ended, directly or through others."""
        return any(c == COMPLETED or self.waits_for_ends(other) for other, c in self.of(name).items())

    def in_order(self, names: Iterable[str]) -> list[str]:
        """The names, each behind those for which it waits."""
        every, ordered = list(names), dict[str, None]()

        def add(name: str) -> None:
            if name in every and name not in ordered:
                for other in self.of(name):
                    add(other)
                ordered[name] = None

        for name in every:
            add(name)
        return list(ordered)

    def started(self, name: str) -> None:
        self._decide(name, STARTED, "")

    def healthy(self, name: str) -> None:
        self._decide(name, HEALTHY, "")

    def unhealthy(self, name: str) -> None:
        self._decide(name, HEALTHY, "is unhealthy")

    def ended(self, name: str, code: int) -> None:
        self._decide(name, HEALTHY, how_it_ended(code))
        self._decide(name, COMPLETED, how_it_ended(code) if code else "")

    def failed(self, name: str) -> None:
        """It could not be started."""
        for condition in _ASKED:
            self._decide(name, condition, "could not be started")

    async def unmet(self, name: str, patience: Mapping[str, float]) -> str:
        """Waits until a service may start; why it never may, in a sentence, else empty.

        ``patience`` is how long another service may take to be healthy, in s, where that is not LONGEST_S.
        """
        for other, asked in self.of(name).items():
            longest = patience.get(other, LONGEST_S) if asked == HEALTHY else LONGEST_S
            why = await self._fact(other, STARTED)
            try:
                async with asyncio.timeout(longest):
                    why = why or await self._fact(other, asked)
            except TimeoutError:
                why = f"did not within {longest:g} s"
            if why:
                return f"it waits for '{other}' to {_ASKED[asked]} (depends_on), which {why}"
        return ""

    def _fact(self, name: str, condition: str) -> "asyncio.Future[str]":
        """Resolves to why the condition will not come true, empty when it has; not to be cancelled by one who waits."""
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


def waits(services: Iterable[ApplicationService], name: str) -> str:
    """Who waits for a service and for what, as half a sentence; empty where nobody does."""
    found = ((s.name, s.after[name]) for s in services if name in s.after)
    told = [f"'{other}' waits for it to {_ASKED[condition]}" for other, condition in found if condition != STARTED]
    return told[0] if told else ""


def one_off(services: Iterable[ApplicationService]) -> set[str]:
    """The services that may end, as others start when they have."""
    return {n for s in services for n, condition in s.after.items() if condition == COMPLETED}


def _without_health(condition: str, has_health: bool) -> str:
    return condition if has_health else condition.replace(HEALTHY, STARTED)
