"""The course of a tuning: the defaults, then generation after generation, and the held-out scenarios at last."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from dodo_dsl.cli.tune.study import Scenario, TuneStudy
from dodo_dsl.cli.tune.trials import Trials, point_of
from dodo_dsl.search.itinerary import Itinerary, key
from dodo_dsl.search.space import nominal
from dodo_dsl.search.store import Store
from dodo_dsl.spec.instances.vary import Values

FINALISTS = 5
"""The best values of a tuning, among which further samples decide: the best of many was lucky with its own."""
_ERROR = -1.0
"""Margin of a drive that ended in error: an application that crashes is worse than any other."""


@dataclass(frozen=True)
class Judged:
    """Values with the objective, a margin from -1 to 1."""

    values: Values
    margin: float


@dataclass
class TuneCourse:
    """``done`` are the values judged, the defaults first, each of them once.

    ``finals`` are the best of them, with their margins in the deciding scenarios, too.
    """

    study: TuneStudy
    itinerary: Itinerary
    store: Store
    mean: bool
    done: list[Judged] = field(default_factory=list)
    finals: list[Judged] = field(default_factory=list)

    @property
    def best(self) -> Judged:
        """The first of those with the greatest margin, after the finals if they were driven."""
        if self.finals:
            values = max(self.finals, key=lambda one: one.margin).values
            return next(one for one in self.done if one.values is values)
        return max(self.done, key=lambda one: one.margin)

    async def follow(self, trials: Trials) -> None:
        """Raises Interrupted and RigFailure."""
        await self._judge(trials, [nominal(self.study.space)], {})
        margins: dict[tuple[str, ...], float | None] = {}
        for batch in self.itinerary.generations(margins):
            candidates = [one.values for one in batch]
            await self._judge(trials, candidates, margins)
            if any(key(values) not in margins for values in candidates):
                break
        if self.done and self.study.held_out:
            trials.deadline = None
            await self._decide(trials)
            await trials.drive([self.done[0].values, self.best.values], self.study.held_out)

    async def _decide(self, trials: Trials) -> None:
        best = sorted(self.done, key=lambda one: -one.margin)[:FINALISTS]
        await trials.drive([one.values for one in best], self.study.deciding)
        scenarios = (*self.study.scenarios, *self.study.deciding)
        margins = [(one.values, self.margin(one.values, scenarios)) for one in best]
        self.finals = [Judged(values, margin) for values, margin in margins if margin is not None]

    async def _judge(
        self, trials: Trials, candidates: Sequence[Values], margins: dict[tuple[str, ...], float | None]
    ) -> None:
        """Drives the candidates; ``margins`` has negative objectives, as an itinerary looks for the least."""
        try:
            await trials.drive(candidates, self.study.scenarios)
        finally:
            seen = {key(one.values) for one in self.done}
            for values in candidates:
                margin = self.margin(values, self.study.scenarios)
                if margin is None:
                    break
                margins[key(values)] = -margin
                if key(values) not in seen:
                    self.done.append(Judged(values, margin))
                    seen.add(key(values))

    def margin(self, values: Values, scenarios: Sequence[Scenario]) -> float | None:
        """The objective; None where a scenario was not driven."""
        drives = [self.store.get(point_of(values, one)) for one in scenarios]
        known = [_ERROR if drive.margin is None else drive.margin for drive in drives if drive]
        if not known or len(known) < len(drives):
            return None
        return sum(known) / len(known) if self.mean else min(known)
