"""Drives of tunings: tests with candidates' values as variables of the application, those of the store only once."""

import itertools
import math
import re
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from dodo_dsl import compiler
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.search.drives import RETRIES, Interrupted, Kept, end_like_interrupt
from dodo_dsl.cli.search.progress import SearchProgress
from dodo_dsl.cli.tune.study import Scenario
from dodo_dsl.diagnostics import format_text, has_errors
from dodo_dsl.emit.output_folder import write
from dodo_dsl.margins import worst_margin
from dodo_dsl.outcome import Outcome
from dodo_dsl.run.backends import Job
from dodo_dsl.run.rigs.attendance import RigSession
from dodo_dsl.run.runner import Policy, Runner
from dodo_dsl.run.schedule import Schedule
from dodo_dsl.search.space import texts
from dodo_dsl.search.store import Drive, Store
from dodo_dsl.source import Entry
from dodo_dsl.spec.instances.vary import Values

_SCENARIO = "#scenario"
"""No name of a variable."""
_ROUND = 4
"""Drives a core in a round."""
_DISTANCE, _FASTEST, _TO_START = ("distance", "m"), 1.0, 2.4
"""The check of how far a vehicle drove, the highest speed of a rig, in m/s, and the way across its table, in m."""
_NUMBERED = re.compile(r"--run-([0-9]{1,9})$")

Pair = tuple[Values, Scenario]


def point_of(candidate: Values, scenario: Scenario) -> dict[str, str]:
    """What names a drive in the store."""
    return {**texts(candidate), _SCENARIO: scenario.name}


class RigFailure(Exception):
    """A test on a rig ended in error, which says nothing of the values; one sentence."""


@dataclass
class Trials:
    """Drives scenarios with any values. ``work`` takes compiled tests, ``report`` what drives that did not pass say.

    On rigs it drives one after the other, at most ``metres`` of way.
    """

    checked: compiler.Checked
    store: Store
    backends: Kept
    order: Schedule
    progress: SearchProgress
    work: Path
    report: Path
    deadline: float | None = None
    metres: float = math.inf
    way: float = 0.0
    """What rigs drove at most, in m."""
    session: RigSession = field(default_factory=RigSession)
    _number: int = 0
    """Of the next drive; those of an earlier call that did not pass, or that was killed, keep theirs."""
    _counted: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        names = [path.name for path in self.report.iterdir()] if self.report.is_dir() else []
        numbers = [int(found[1]) for name in names if (found := _NUMBERED.search(name))]
        self._number = max(numbers, default=-1) + 1

    @property
    def is_over(self) -> bool:
        return self.way >= self.metres or (self.deadline is not None and time.monotonic() >= self.deadline)

    async def drive(self, candidates: Sequence[Values], scenarios: Sequence[Scenario]) -> None:
        """Drives each candidate in all scenarios, as far as time and way suffice. Raises Interrupted and RigFailure."""
        missing: list[Pair] = []
        for candidate, scenario in itertools.product(candidates, scenarios):
            point = point_of(candidate, scenario)
            known, name = self.store.get(point), str(point)
            if known and name not in self._counted:
                self.progress.count(known)
            elif not known and name not in self._counted:
                missing.append((candidate, scenario))
            self._counted.add(name)
        size = max(1, int(self.order.capacity)) * (_ROUND if self.deadline is None else 1)
        if any(scenario.spec.rig for scenario in scenarios):
            size = 1
        for batch in _batches(missing, size):
            if self.is_over:
                break
            await self._round(batch)

    async def _round(self, pairs: Sequence[Pair]) -> None:
        numbered = dict(enumerate(pairs, self._number))
        self._number += len(pairs)
        folder = self.work / f"round-{min(numbered)}"
        jobs = self._jobs(numbered, folder)
        by_slug = {job.plan.slug: number for number, job in jobs.items()}
        runner = Runner(self.progress, self.backends, self.order, Policy(retries=RETRIES))

        failures: list[str] = []
        before = self.backends.opened

        def take(outcome: Outcome) -> Drive | None:
            if runner.interrupted:
                return None
            number = by_slug[outcome.slug]
            if rig := jobs[number].plan.rig:
                self.way += (self.backends.opened - before) * _way(outcome)
                if outcome.outcome == "error":
                    failures.append(outcome.reason)
                    return None
                self.session.fit.add(rig)
            point = point_of(*numbered[number])
            drive = Drive(number, point, outcome.outcome, worst_margin(outcome), outcome.reason)
            self.store.add(drive)
            if outcome.outcome == "passed":
                shutil.rmtree(jobs[number].report, ignore_errors=True)
            return drive

        self.progress.take = take
        await runner.run(list(jobs.values()))
        end_like_interrupt()
        shutil.rmtree(folder, ignore_errors=True)
        if runner.interrupted:
            raise Interrupted
        if failures:
            raise RigFailure(failures[0])

    def _jobs(self, numbered: dict[int, Pair], folder: Path) -> dict[int, Job]:
        tests = {}
        for number, (candidate, scenario) in numbered.items():
            (test,) = compiler.at_values(self.checked, scenario.spec, {str(number): scenario.values}).tests
            given = {name: Entry(value.span, value) for name, value in candidate.items()}
            tests[number] = replace(test, spec=replace(test.spec, variables=test.spec.variables | given))
        made = compiler.plan(replace(self.checked, tests=tuple(tests.values()), diagnostics=()), folder)
        if has_errors(made.problems):
            raise UsageError(f"these values cannot be driven:\n{format_text(made.problems)}")
        write(made.compiled, made.pipeline, folder)
        plans = {plan.slug: plan for plan in made.compiled.suite.plans}
        slugs = {number: test.spec.slug for number, test in tests.items()}
        titles = {number: scenario.spec.slug for number, (_, scenario) in numbered.items()}
        return {n: Job(plans[slug], folder / slug, self.report / slug, titles[n]) for n, slug in slugs.items()}


def _way(outcome: Outcome) -> float:
    """What a rig drove at most in a test and to its start, in m; by the time where no check says it."""
    said = [check["value"] for check in outcome.checks if (check["name"], check["unit"]) == _DISTANCE]
    driven = [float(value) for value in said if value is not None]
    return _TO_START + (max(driven) if driven else _FASTEST * (outcome.execution_s or 0.0))


def _batches(pairs: Sequence[Pair], size: int) -> list[Sequence[Pair]]:
    return [pairs[start : start + size] for start in range(0, len(pairs), size)]
