"""The order in which services of the application start: by the conditions of their ``depends_on``."""

import asyncio
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping

from dodo_dsl.plan.model import COMPLETED, HEALTHY, STARTED, ApplicationService
from dodo_dsl.run.outcomes import how_it_ended

LONGEST_S = 600.0
"""The longest that a service waits for a condition to come true, in s, once the other one has started."""
_ASKED = {STARTED: "start", HEALTHY: "be healthy", COMPLETED: "end with exit code 0"}
UNHEALTHY, LATE = "is unhealthy", f"did not within {LONGEST_S:g} s"


class Conditions:
    """What became of an application's services, for those that wait for it; belongs to one event loop."""

    def __init__(self, services: Iterable[ApplicationService]) -> None:
        services = tuple(services)
        self._after = {s.name: s.after for s in services}
        self._optional = {s.name: s.optional for s in services}
        self._known: dict[tuple[str, str], asyncio.Future[str]] = defaultdict(asyncio.Future)

    def of(self, name: str) -> Mapping[str, str]:
        return self._after.get(name, {})

    def decide(self, name: str, condition: str, why: str = "") -> None:
        """The condition of a service is true from now on; with ``why`` it never will be. The first word counts."""
        if not (known := self._known[name, condition]).done():
            known.set_result(why)

    def ended(self, name: str, code: int) -> None:
        self.decide(name, HEALTHY, how_it_ended(code))
        self.decide(name, COMPLETED, how_it_ended(code) if code else "")

    def failed(self, name: str) -> None:
        for condition in _ASKED:
            self.decide(name, condition, "could not be started")

    async def unmet(self, name: str, note: Callable[[str], None]) -> str:
        """Waits until a service may start; why it never may, in a sentence, else empty.

        ``note`` gets a sentence for each optional service without which it starts.
        """
        for other, asked in self.of(name).items():
            why = await self.why_not(other, STARTED) or await self.why_not(other, asked)
            told = f"it waits for '{other}' to {_ASKED[asked]} (depends_on), which {why}"
            if why and other not in self._optional[name]:
                return told
            if why:
                note(f"service '{name}' starts all the same (required: false): {told}")
        return ""

    async def why_not(self, name: str, condition: str) -> str:
        """Waits until a condition has come true; why it will not, else empty."""
        try:
            async with asyncio.timeout(LONGEST_S):
                return await self._known_of(name, condition)
        except TimeoutError:
            return LATE

    def _known_of(self, name: str, condition: str) -> "asyncio.Future[str]":
        return asyncio.shield(self._known[name, condition])  # as who waits may give up


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
