"""A tuning: the defaults, then choices of Optuna's sampler TPE, each in all scenarios.

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

    def point(self, choice: Values) -> SearchPoint:
        """The drive with a choice's values as variables of the application."""
        return SearchPoint(self.spec, self.values, {**texts(choice), _SCENARIO: self.name}, choice)


def scenarios(tests: Sequence[ResolvedTest], samples: int, seed: int) -> list[Scenario]:
    """Each test at its nominal values and at samples of its ranges."""
    found: dict[str, Scenario] = {}
    for test in tests:
        points = sweep(space_of(test), samples, seed) if test.spec.ranges else ()
        for values in (vary.nominal(test.spec.ranges), *points):
            one = Scenario(test.spec, values)
            found[one.name] = one
    return list(found.values())


@dataclass(frozen=True)
class JudgedChoice:
    """Values with the objective: the worst margin of all scenarios, from -1 to 1."""

    values: Values
    margin: float


@dataclass
class Tuning:
    """``done`` are the values judged, the defaults first, each of them once."""

    space: Space
    scenarios: Sequence[Scenario]
    runs: int
    seed: int
    drives: Drives
    done: list[JudgedChoice] = field(default_factory=list)
    number: int = 0
    """Of the next drive."""

    @property
    def best(self) -> JudgedChoice:
        """The first of those with the greatest margin."""
        return max(self.done, key=lambda one: one.margin)

    async def follow(self) -> None:
        """Raises Interrupted."""
        await self._judge([nominal(self.space)])
        study, ranges = self._study()
        for begin in range(0, self.runs, _TOGETHER):
            trials = [study.ask(ranges) for _ in range(min(_TOGETHER, self.runs - begin))]
            margins = await self._judge([self.space.values(tuple(t.params[name] for name in ranges)) for t in trials])
            for trial, margin in zip(trials, margins, strict=True):
                study.tell(trial, margin)

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
        """The objective of each; after an interrupt, those driven in all scenarios are done, too."""
        points = [one.point(values) for values, one in itertools.product(choices, self.scenarios)]
        first, self.number = self.number, self.number + len(points)
        margins: list[float] = []
        try:
            await self.drives.drive(points, first)
        finally:
            for values in choices:
                drives = self.drives.store.known([one.point(values).name for one in self.scenarios])
                known = [_ERROR if drive.margin is None else drive.margin for drive in drives if drive]
                if len(known) < len(drives):
                    break
                margins.append(min(known))
                if values not in (one.values for one in self.done):
                    self.done.append(JudgedChoice(values, margins[-1]))
        return margins


def document(tuning: Tuning) -> dict[str, Any]:
    """The contents of ``tune.json``, of a tuning that judged the defaults.

    ``progress`` has the values in the order in which they were driven.
    """
    first, best = tuning.done[0], tuning.best
    bests = itertools.accumulate((one.margin for one in tuning.done), max)
    return {
        "seed": tuning.seed,
        "scenarios": [one.name for one in tuning.scenarios],
        "default": {"values": texts(first.values), "margin": first.margin},
        "best": {"values": texts(best.values), "margin": best.margin},
        "progress": [
            {"values": texts(one.values), "margin": one.margin, "best": margin}
            for one, margin in zip(tuning.done, bests, strict=True)
        ],
    }


def env(tuning: Tuning) -> str:
    """The contents of ``best.env``."""
    return "".join(f"{name}={text}\n" for name, text in texts(tuning.best.values).items())


def lines(tuning: Tuning) -> Iterator[str]:
    """The result as text."""
    first, best = tuning.done[0], tuning.best
    yield ""
    for one in tuning.space.ranges:
        yield printable(f"{one.name}  {best.values[one.name].text}  (default {first.values[one.name].text})")
    yield f"worst margin  {best.margin:.3f}  (default {first.margin:.3f})"
    if best is first:
        yield "no values are better than the defaults"
