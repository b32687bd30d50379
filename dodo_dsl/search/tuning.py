"""A tuning: the defaults, then choices of Optuna's sampler TPE in all scenarios, and at last held-out scenarios.

The sampler gets margins in the order of the choices, so that these depend on the seed and on earlier drives alone.
"""

import itertools
import json
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.search.drives import Drives, SearchPoint
from dodo_dsl.search.space import Space, nominal, sobol, space_of, sweep, texts
from dodo_dsl.spec import vary
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.vary import Values
from dodo_dsl.terminal import printable

if TYPE_CHECKING:
    from optuna import Study
    from optuna.distributions import BaseDistribution

_TOGETHER = 8
"""Choices of a generation; those of the first one fill the ranges evenly."""
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
    """Some that are ``guiding`` the tuning, and others that are ``held_out`` to judge the choice."""

    guiding: tuple[Scenario, ...]
    held_out: tuple[Scenario, ...] = ()

    def most_drives(self, runs: int) -> int:
        """Defaults and choices in all that guide, and both in those held out."""
        return (runs + 1) * len(self.guiding) + 2 * len(self.held_out)


def scenarios(tests: Sequence[ResolvedTest], samples: int, seed: int) -> Scenarios:
    """Each test at its nominal values and at samples of its ranges; and as many other samples to judge."""
    guiding: dict[str, Scenario] = {}
    held_out: dict[str, Scenario] = {}
    for test in tests:
        points = list(sweep(space_of(test), 2 * samples, seed)) if test.spec.ranges else []
        for values in (vary.nominal(test.spec.ranges), *points[:samples]):
            one = Scenario(test.spec, values)
            guiding[one.name] = one
        held_out |= {one.name: one for one in (Scenario(test.spec, values) for values in points[samples:])}
    return Scenarios(tuple(guiding.values()), tuple(one for name, one in held_out.items() if name not in guiding))


@dataclass(frozen=True)
class JudgedPoint:
    """Values with the objective, a margin from -1 to 1."""

    values: Values
    margin: float


@dataclass
class Tuning:
    """``done`` are the values judged, the defaults first, each of them once."""

    space: Space
    scenarios: Scenarios
    runs: int
    seed: int
    drives: Drives
    mean: bool
    done: list[JudgedPoint] = field(default_factory=list)

    @property
    def best(self) -> JudgedPoint:
        """The first of those with the greatest margin."""
        return max(self.done, key=lambda one: one.margin)

    async def follow(self) -> None:
        """Raises Interrupted."""
        margins = await self._judge([nominal(self.space)])
        study, ranges = self._study()
        for begin in range(0, self.runs if margins else 0, _TOGETHER):
            trials = [study.ask(ranges) for _ in range(min(_TOGETHER, self.runs - begin))]
            choices = [self.space.values(tuple(trial.params[name] for name in ranges)) for trial in trials]
            margins = await self._judge(choices)
            if len(margins) < len(choices):
                break
            for trial, margin in zip(trials, margins, strict=True):
                study.tell(trial, margin)
        if self.done:
            self.drives.deadline = None
            await self._drive([self.done[0].values, self.best.values], self.scenarios.held_out)

    def _study(self) -> "tuple[Study, dict[str, BaseDistribution]]":
        """One in memory, which begins evenly, and its parameters: shares of the ranges."""
        import optuna

        names = [one.name for one in self.space.ranges]
        with warnings.catch_warnings(action="ignore"):  # of options that Optuna calls experimental
            sampler = optuna.samplers.TPESampler(
                seed=self.seed, multivariate=True, constant_liar=True, n_startup_trials=_TOGETHER
            )
        study = optuna.create_study(direction="maximize", sampler=sampler)
        for point in sobol(len(names), _TOGETHER, self.seed):
            study.enqueue_trial(dict(zip(names, point, strict=True)))
        return study, {name: optuna.distributions.FloatDistribution(0, 1) for name in names}

    async def _judge(self, choices: Sequence[Values]) -> list[float]:
        """The objective of each, up to the first that was not driven in all scenarios."""
        try:
            await self._drive(choices, self.scenarios.guiding)
        finally:
            margins: list[float] = []
            for values in choices:
                margin = self.margin(values, self.scenarios.guiding)
                if margin is None:
                    break
                margins.append(margin)
                if values not in (one.values for one in self.done):
                    self.done.append(JudgedPoint(values, margin))
        return margins

    async def _drive(self, choices: Sequence[Values], scenarios: Sequence[Scenario]) -> None:
        await self.drives.drive([one.point(values) for values, one in itertools.product(choices, scenarios)])

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
        "seed": tuning.seed,
        "scenarios": [one.name for one in tuning.scenarios.guiding],
        "default": {"values": texts(first.values), "margin": first.margin},
        "best": {"values": texts(best.values), "margin": best.margin},
        "progress": [
            {"values": texts(one.values), "margin": one.margin, "best": margin}
            for one, margin in zip(tuning.done, bests, strict=True)
        ],
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
    for one in tuning.space.ranges:
        rows.append((one.name, first.values[one.name].text, best.values[one.name].text, one.text))
    rows.append((f"{'mean' if tuning.mean else 'worst'} margin", f"{first.margin:.3f}", f"{best.margin:.3f}", ""))
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
