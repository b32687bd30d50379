"""A tuning: the defaults, then generation after generation in all scenarios, finals, and held-out scenarios at last."""

import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.search.drives import Drives, SearchPoint
from dodo_dsl.search.search_loop import Candidate, Margins, SamplingOrder, key
from dodo_dsl.search.space import Space, nominal, space_of, sweep, texts
from dodo_dsl.spec import vary
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.vary import Values
from dodo_dsl.terminal import printable

FINALISTS = 5
"""The best values of a tuning, among which further samples decide: the best of many was lucky with its own."""
_SWEPT = 1
"""Drives of the sweep in a generation: a tuning looks for the best values, and not for an even cover."""
_ERROR = -1.0
"""Margin of a drive that ended in error: an application that crashes is worse than any other."""
_SCENARIO = "#scenario"
"""No name of a variable."""


@dataclass(frozen=True)
class Scenario:
    """A test at values of its ranges, none for one without ranges."""

    spec: Spec
    values: Values

    @property
    def name(self) -> str:
        return json.dumps([self.spec.slug, texts(self.values)], ensure_ascii=False)

    def point(self, candidate: Values) -> SearchPoint:
        """The drive with a candidate's values as variables of the application."""
        return SearchPoint(self.spec, self.values, {**texts(candidate), _SCENARIO: self.name}, candidate)


@dataclass(frozen=True)
class Scenarios:
    """Some that are ``guiding`` the tuning, ``deciding`` among the best of it, and ``held_out`` to judge the choice."""

    guiding: tuple[Scenario, ...]
    deciding: tuple[Scenario, ...] = ()
    held_out: tuple[Scenario, ...] = ()

    @property
    def rigs(self) -> list[str]:
        """Names of the rigs that are driven."""
        return sorted({one.spec.rig for one in self.guiding if one.spec.rig})

    def most_drives(self, runs: int) -> int:
        """Defaults and choices in all that guide, the finals, and both in those held out."""
        return (runs + 1) * len(self.guiding) + FINALISTS * len(self.deciding) + 2 * len(self.held_out)


def scenarios(tests: Sequence[ResolvedTest], samples: int, seed: int) -> Scenarios:
    """Each test at its nominal values and at samples of its ranges; then as many other samples to decide, and to judge.

    No scenario is in two of them.
    """
    guiding: list[Scenario] = []
    deciding: list[Scenario] = []
    held_out: list[Scenario] = []
    for test in tests:
        points = _points(test, samples, seed)
        guiding += [Scenario(test.spec, vary.nominal(test.spec.ranges)), *_next(test, points, samples)]
        held_out += _next(test, points, samples)
        deciding += _next(test, points, samples)
    used = {one.name: one for one in guiding}
    judging = {one.name: one for one in held_out if one.name not in used}
    others = {one.name: one for one in deciding if one.name not in used and one.name not in judging}
    return Scenarios(tuple(used.values()), tuple(others.values()), tuple(judging.values()))


def _next(test: ResolvedTest, points: Iterator[Values], number: int) -> list[Scenario]:
    return [Scenario(test.spec, values) for values in itertools.islice(points, number)]


def _points(test: ResolvedTest, samples: int, seed: int) -> Iterator[Values]:
    return sweep(space_of(test), 3 * samples, seed) if samples and test.spec.ranges else iter(())


def tuning_order(space: Space, runs: int, seed: int) -> SamplingOrder:
    return SamplingOrder(space, runs, seed, seeks_best=True, swept=_SWEPT)


@dataclass(frozen=True)
class JudgedPoint:
    """Values with the objective, a margin from -1 to 1."""

    values: Values
    margin: float


@dataclass
class Tuning:
    """``done`` are the values judged, the defaults first, each of them once.

    ``finals`` are the best of them, with their margins in the deciding scenarios, too.
    """

    scenarios: Scenarios
    order: SamplingOrder
    drives: Drives
    mean: bool
    done: list[JudgedPoint] = field(default_factory=list)
    finals: list[JudgedPoint] = field(default_factory=list)

    @property
    def best(self) -> JudgedPoint:
        """The first of those with the greatest margin, after the finals if they were driven."""
        if self.finals:
            values = max(self.finals, key=lambda one: one.margin).values
            return next(one for one in self.done if one.values is values)
        return max(self.done, key=lambda one: one.margin)

    async def follow(self) -> None:
        """Raises Interrupted and RigFailure."""
        await self._judge([Candidate(nominal(self.order.space), swept=False)], {})
        await self.order.follow(self._judge)
        if self.done and self.scenarios.held_out:
            self.drives.limits.deadline = None
            await self._decide()
            await self._drive([self.done[0].values, self.best.values], self.scenarios.held_out)

    async def _decide(self) -> None:
        best = sorted(self.done, key=lambda one: -one.margin)[:FINALISTS]
        await self._drive([one.values for one in best], self.scenarios.deciding)
        both = (*self.scenarios.guiding, *self.scenarios.deciding)
        margins = [(one.values, self.margin(one.values, both)) for one in best]
        self.finals = [JudgedPoint(values, margin) for values, margin in margins if margin is not None]

    async def _judge(self, batch: Sequence[Candidate], margins: Margins) -> bool:
        """Drives the candidates; ``margins`` has negative objectives, as an order looks for the least."""
        try:
            await self._drive([one.values for one in batch], self.scenarios.guiding)
        finally:
            self._take(batch, margins)
        return all(key(one.values) in margins for one in batch)

    def _take(self, batch: Sequence[Candidate], margins: Margins) -> None:
        """What is known of the candidates, up to the first that was not driven in all scenarios."""
        seen = {key(one.values) for one in self.done}
        for values in (one.values for one in batch):
            margin = self.margin(values, self.scenarios.guiding)
            if margin is None:
                return
            margins[key(values)] = -margin
            if key(values) not in seen:
                self.done.append(JudgedPoint(values, margin))
                seen.add(key(values))

    async def _drive(self, candidates: Sequence[Values], scenarios: Sequence[Scenario]) -> None:
        await self.drives.drive([one.point(values) for values, one in itertools.product(candidates, scenarios)])

    def margin(self, values: Values, scenarios: Sequence[Scenario]) -> float | None:
        """The objective; None if a scenario was not driven."""
        drives = self.drives.store.known([one.point(values).name for one in scenarios])
        known = [_ERROR if drive.margin is None else drive.margin for drive in drives if drive]
        if not known or len(known) < len(drives):
            return None
        return sum(known) / len(known) if self.mean else min(known)


def document(tuning: Tuning) -> dict[str, Any]:
    """The contents of ``tune.json``, of a tuning that judged the defaults.

    ``progress`` has the values in the order in which they were driven.
    """
    first, best = tuning.done[0], tuning.best
    bests = itertools.accumulate((one.margin for one in tuning.done), max)
    held_out = tuning.scenarios.held_out
    return {
        "objective": "mean" if tuning.mean else "worst",
        "seed": tuning.order.seed,
        "scenarios": [one.name for one in tuning.scenarios.guiding],
        "default": {"values": texts(first.values), "margin": first.margin},
        "best": {"values": texts(best.values), "margin": best.margin},
        "progress": [
            {"values": texts(one.values), "margin": one.margin, "best": margin}
            for one, margin in zip(tuning.done, bests, strict=True)
        ],
        "finals": {
            "scenarios": [one.name for one in tuning.scenarios.deciding],
            "values": [{"values": texts(one.values), "margin": one.margin} for one in tuning.finals],
        },
        "held_out": {
            "scenarios": [one.name for one in held_out],
            "default": [tuning.margin(first.values, [one]) for one in held_out],
            "best": [tuning.margin(best.values, [one]) for one in held_out],
        },
    }


def env(tuning: Tuning) -> str:
    """The contents of ``best.env``."""
    return "".join(f"{name}={text}\n" for name, text in texts(tuning.best.values).items())


def table(tuning: Tuning) -> Iterator[str]:
    """The result as text."""
    first, best = tuning.done[0], tuning.best
    held_out = tuning.scenarios.held_out
    rows = [("", "default", "best", "range")]
    for one in tuning.order.space.ranges:
        rows.append((one.name, first.values[one.name].text, best.values[one.name].text, one.text))
    rows.append((f"{'mean' if tuning.mean else 'worst'} margin", f"{first.margin:.3f}", f"{best.margin:.3f}", ""))
    if tuning.finals:
        chosen = max(one.margin for one in tuning.finals)
        said = f"chosen among the best {len(tuning.finals)} with {len(tuning.scenarios.deciding)} more samples"
        rows.append(("of the finals", "", f"{chosen:.3f}", said))
    if held_out:
        before, after = (_shown(tuning.margin(one.values, held_out)) for one in (first, best))
        rows.append(("held out", before, after, f"{len(held_out)} samples that did not guide the tuning"))
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    yield ""
    for row in rows:
        cells = [row[0].ljust(widths[0]), row[1].rjust(widths[1]), row[2].rjust(widths[2]), row[3]]
        yield printable("  ".join(cells).rstrip())
    if best is first:
        yield "no values are better than the defaults"


def _shown(margin: float | None) -> str:
    return "unknown" if margin is None else f"{margin:.3f}"
