"""Drives of a search: candidates compiled as tests and run in rounds, those of the store only once."""

import itertools
import shutil
import time
from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import compiler
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.search.progress import SearchProgress
from dodo_dsl.diagnostics import format_text, has_errors
from dodo_dsl.emit.output_folder import write
from dodo_dsl.margins import worst_margin
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.backends import Backends, Job, Say
from dodo_dsl.run.protocol import Backend
from dodo_dsl.run.runner import Policy, Runner
from dodo_dsl.run.schedule import Schedule
from dodo_dsl.search.space import texts
from dodo_dsl.search.store import Drive, Store
from dodo_dsl.spec.instances.vary import Values
from dodo_dsl.spec.model import Spec

_ROUND = 8
"""Drives a core in a round, so that cores hardly wait for its last one; one where time ends the search."""
RETRIES = 1
"""A drive that ended in error is driven once more, and left out when it does so again."""


class Interrupted(Exception):
    """Ctrl-C or a signal ended the search; everything until then is kept."""


class Kept:
    """Backends for several rounds: prepared before the first one, and closed by ``end``."""

    def __init__(self, backends: Backends) -> None:
        self._backends = backends
        self.name = backends.name
        self._is_prepared = False

    async def prepare(self, plans: Sequence[Plan], note: Say) -> None:
        if not self._is_prepared:
            self._is_prepared = True
            await self._backends.prepare(plans, note)

    def close(self) -> None:
        """The next round needs them."""

    def end(self) -> None:
        self._backends.close()

    def open(self, job: Job, say: Say, keep: bool) -> AbstractAsyncContextManager[Backend]:
        return self._backends.open(job, say, keep)


@dataclass
class Drives:
    """Drives a test at any values. ``work`` takes compiled tests, ``report`` what drives say."""

    checked: compiler.Checked
    spec: Spec
    store: Store
    backends: Kept
    order: Schedule
    progress: SearchProgress
    work: Path
    report: Path
    deadline: float | None = None

    @property
    def is_over(self) -> bool:
        """Whether the time for the search is over."""
        return self.deadline is not None and time.monotonic() >= self.deadline

    def known(self, candidates: Sequence[Values]) -> list[Drive]:
        """The drives of the candidates, up to the first that was not driven."""
        found = (self.store.get(texts(values)) for values in candidates)
        return [drive for drive in itertools.takewhile(lambda drive: drive is not None, found) if drive]

    async def drive(self, candidates: Sequence[Values], first: int) -> None:
        """Drives the candidates, numbered from ``first`` on, as far as time suffices.

        Candidates with the same values share a drive. Raises Interrupted.
        """
        numbers: dict[int, Values] = {}
        seen = set()
        for number, values in enumerate(candidates, first):
            key = tuple(texts(values).items())
            known = self.store.get(texts(values)) if key not in seen else None
            if known:
                self.progress.count(known)
            elif key not in seen:
                numbers[number] = values
            seen.add(key)
        size = max(1, int(self.order.capacity)) * (_ROUND if self.deadline is None else 1)
        missing = list(numbers.items())
        for start in range(0, len(missing), size):
            if self.is_over:
                break
            await self._round(dict(missing[start : start + size]))

    async def _round(self, candidates: dict[int, Values]) -> None:
        folder = self.work / f"round-{min(candidates)}"
        jobs = self._jobs(candidates, folder)
        by_slug = {job.plan.slug: number for number, job in jobs.items()}
        runner = Runner(self.progress, self.backends, self.order, Policy(retries=RETRIES))

        def take(outcome: Outcome) -> Drive | None:
            if runner.interrupted:
                return None
            number = by_slug[outcome.slug]
            margin = worst_margin(outcome)
            drive = Drive(number, texts(candidates[number]), outcome.outcome, margin, outcome.reason)
            self.store.add(drive)
            if outcome.outcome == "passed":
                shutil.rmtree(jobs[number].report, ignore_errors=True)
            return drive

        self.progress.take = take
        await runner.run(list(jobs.values()))
        shutil.rmtree(folder, ignore_errors=True)
        if runner.interrupted:
            raise Interrupted

    def _jobs(self, candidates: dict[int, Values], folder: Path) -> dict[int, Job]:
        values = {str(number): one for number, one in candidates.items()}
        checked = compiler.at_values(self.checked, self.spec, values)
        made = compiler.plan(checked, folder)
        if has_errors(made.problems):
            raise UsageError(f"these values cannot be driven:\n{format_text(made.problems)}")
        write(made.compiled, made.pipeline, folder)
        plans = {plan.slug: plan for plan in made.compiled.suite.plans}
        slugs = dict(zip(candidates, (test.spec.slug for test in checked.tests), strict=True))
        drives = self.report / "drives"
        return {n: Job(plans[slug], folder / slug, drives / slug, self.spec.slug) for n, slug in slugs.items()}
