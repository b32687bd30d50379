"""Drives of a search or a tuning: points compiled as tests and run in rounds, those of the store only once."""

import asyncio
import random
import shutil
import signal
from collections.abc import Coroutine, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from dodo_dsl import compiler
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.diagnostics import format_text, has_errors
from dodo_dsl.emit.output_folder import write
from dodo_dsl.outcome import Outcome, failed_checks, worst_margin
from dodo_dsl.run.backends import CombinedBackends, Job
from dodo_dsl.run.runner import Progress, Runner
from dodo_dsl.run.schedule import Schedule
from dodo_dsl.search.space import texts
from dodo_dsl.search.store import Drive, Store, point_text
from dodo_dsl.search.study import NotSearchable
from dodo_dsl.source import Entry
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.vary import Values

_REPEAT = "#"
"""No name of a range."""
_A_CORE = 8
"""Drives of a round for each core."""
_RETRIES = 1
"""A drive that ended in error is driven once more, and left out when it does so again."""


class Interrupted(Exception):
    """Ctrl-C or a signal ended the drives; everything until then is kept."""


def end_like_interrupt() -> None:
    """SIGTERM and SIGHUP end the drives as Ctrl-C does, and that at once: asyncio would only cancel its task."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)


@dataclass(frozen=True)
class SearchPoint:
    """A test at values of its ranges, none for one without ranges, with ``variables`` for its application.

    ``name`` names its drive in the store.
    """

    spec: Spec
    values: Values
    name: Mapping[str, str]
    variables: Values = field(default_factory=dict)


def point_at(spec: Spec, values: Values, repeat: int = 1) -> SearchPoint:
    """The point of a search."""
    return SearchPoint(spec, values, drive_name(values, repeat))


def drive_name(values: Values, repeat: int = 1) -> dict[str, str]:
    """What names a drive of a search: its values, and from the second one on its number among those at them."""
    return texts(values) | ({_REPEAT: str(repeat)} if repeat > 1 else {})


@dataclass
class Drives:
    """Drives points in rounds, which are short where the store is ``shared`` with other workers.

    ``work`` takes compiled tests, and ``folder`` what drives that did not pass say.
    """

    checked: compiler.Checked
    store: Store
    backends: CombinedBackends
    order: Schedule
    work: Path
    progress: Progress
    folder: Path
    shared: bool = False

    def run(self, work: Coroutine[Any, Any, None]) -> bool:
        """Does work that drives, and closes the backends. Whether an interrupt ended it early."""
        try:
            asyncio.run(work)
        except (Interrupted, KeyboardInterrupt):
            return True
        finally:
            self.backends.close()
        return False

    async def drive(self, points: Sequence[SearchPoint], first: int) -> None:
        """Drives the points, numbered from ``first`` on; those with the same name share a drive. Raises Interrupted."""
        missing: dict[str, tuple[int, SearchPoint]] = {}
        for number, point in enumerate(points, first):
            missing.setdefault(point_text(point.name), (number, point))
        size = self._size(points)
        while True:
            drives = self.store.known([point.name for _, point in missing.values()])
            missing = {name: missing[name] for name, drive in zip([*missing], drives, strict=True) if not drive}
            if not missing:
                return
            # workers that begin at different points hardly ever make the same drive
            begin = random.randrange(len(missing)) if self.shared else 0  # noqa: S311
            await self._round(dict([*missing.values()][begin : begin + size]))

    def _size(self, points: Sequence[SearchPoint]) -> int:
        """How many drives a round has."""
        size = max(1, int(self.order.capacity)) * (1 if self.shared else _A_CORE)
        on_host = any(point.spec.isolation == "host" for point in points)
        return min(size, len(self.checked.deployment.cids)) if on_host else size

    async def _round(self, points: dict[int, SearchPoint]) -> None:
        folder = self.work / f"round-{min(points)}"
        jobs = self._jobs(points, folder)
        by_slug = {job.plan.slug: number for number, job in jobs.items()}
        runner = Runner(self.progress, self.backends, self.order, retries=_RETRIES)

        def take(job: Job, outcome: Outcome) -> None:
            if not runner.interrupted:
                number = by_slug[outcome.slug]
                self._keep(number, points[number], outcome)
                if outcome.outcome != "passed" and job.report.exists():
                    self.folder.mkdir(parents=True, exist_ok=True)
                    shutil.rmtree(self.folder / outcome.slug, ignore_errors=True)
                    shutil.move(job.report, self.folder / outcome.slug)

        await runner.run(list(jobs.values()), take)
        end_like_interrupt()
        shutil.rmtree(folder, ignore_errors=True)
        if runner.interrupted:
            raise Interrupted

    def _keep(self, number: int, point: SearchPoint, outcome: Outcome) -> None:
        checks = ",".join(failed_checks(outcome))
        drive = Drive(number, point.name, outcome.outcome, worst_margin(outcome), outcome.reason, checks)
        self.store.add(drive)
        margin = "" if drive.margin is None else f", margin {drive.margin:.3f}"
        self.progress.note(f"drive {number}: {drive.outcome}{margin}")

    def _jobs(self, points: dict[int, SearchPoint], folder: Path) -> dict[int, Job]:
        tests = {number: self._test(number, point) for number, point in points.items()}
        made = compiler.plan(replace(self.checked, tests=tuple(tests.values()), diagnostics=()), folder)
        if has_errors(made.problems):
            raise NotSearchable(f"these values cannot be driven:\n{format_text(made.problems)}")
        write(made.compiled, made.pipeline, folder)
        plans = {plan.slug: plan for plan in made.compiled.suite.plans}
        slugs = {number: test.spec.slug for number, test in tests.items()}
        return {
            n: Job(plans[slug], folder / slug, folder / "report" / slug, points[n].spec.slug, work=folder)
            for n, slug in slugs.items()
        }

    def _test(self, number: int, point: SearchPoint) -> ResolvedTest:
        (test,) = compiler.at_values(self.checked, point.spec, {str(number): point.values}).tests
        given = {name: Entry(value.span, value) for name, value in point.variables.items()}
        return replace(test, spec=replace(test.spec, variables=test.spec.variables | given)) if given else test
