"""Drives of a search: candidates compiled as tests and run in rounds, those of the store only once."""

import itertools
import shutil
import signal
import time
from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl import compiler
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.run.uninterrupted import stop_like_interrupt
from dodo_dsl.cli.search.progress import SearchProgress
from dodo_dsl.diagnostics import format_text, has_errors
from dodo_dsl.emit.output_folder import write
from dodo_dsl.margins import failed_checks, worst_margin
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.backends import Backends, Job, Say
from dodo_dsl.run.protocol import Backend
from dodo_dsl.run.runner import Policy, Runner
from dodo_dsl.run.schedule import Schedule
from dodo_dsl.search.itinerary import key
from dodo_dsl.search.space import texts
from dodo_dsl.search.store import Drive, Store
from dodo_dsl.spec.instances.vary import Values
from dodo_dsl.spec.model import Spec

_ROUND = 8
"""Drives a core in a round, so that cores hardly wait for its last one; one where time or workers share the search."""
_WINDOW = 256
"""Candidates that are looked at for the next round, more than workers could drive at once."""
_REPEAT = "#"
"""No name of a range."""
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
        self.opened = 0
        """How many attempts at tests began."""

    async def prepare(self, plans: Sequence[Plan], note: Say) -> None:
        if not self._is_prepared:
            self._is_prepared = True
            await self._backends.prepare(plans, note)

    def close(self) -> None:
        """The next round needs them."""

    def end(self) -> None:
        self._backends.close()

    def open(self, job: Job, say: Say, keep: bool) -> AbstractAsyncContextManager[Backend]:
        self.opened += 1
        return self._backends.open(job, say, keep)


def end_like_interrupt() -> None:
    """SIGTERM and SIGHUP end the search as Ctrl-C does, and that at once: asyncio would only cancel its task."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, stop_like_interrupt)


def repeated(values: Values, repeat: int) -> dict[str, str]:
    """What names a drive in the store: its values, and from the second one on its number among those at them."""
    return texts(values) | ({_REPEAT: str(repeat)} if repeat > 1 else {})


@dataclass
class Drives:
    """Drives a test at any values. ``work`` takes compiled tests, ``folder`` of ``report`` what drives say."""

    checked: compiler.Checked
    spec: Spec
    store: Store
    backends: Kept
    order: Schedule
    progress: SearchProgress
    work: Path
    report: Path
    deadline: float | None = None
    folder: str = "drives"
    _counted: set[tuple[str, ...]] = field(default_factory=set)

    @property
    def is_over(self) -> bool:
        """Whether the time for the search is over."""
        return self.deadline is not None and time.monotonic() >= self.deadline

    async def drive(self, candidates: Sequence[Values], first: int, repeat: int = 1) -> None:
        """Drives the candidates, numbered from ``first`` on, as far as time suffices.

        Candidates with the same values share a drive, but for each ``repeat``. Raises Interrupted.
        """
        missing: dict[int, Values] = {}
        known = self.store.known([repeated(values, repeat) for values in candidates])
        for number, (values, drive) in enumerate(zip(candidates, known, strict=True), first):
            point = (*key(values), str(repeat))
            if point in self._counted:
                continue
            self._counted.add(point)
            if drive:
                self.progress.count(drive, repeat)
            else:
                missing[number] = values
        is_long = self.deadline is None and not self.store.is_shared
        size = max(1, int(self.order.capacity)) * (_ROUND if is_long else 1)
        while missing and not self.is_over:
            if claimed := self._claimed(missing, size, repeat):
                await self._round(claimed, repeat)
            elif missing:
                end_like_interrupt()
                self.store.wait()

    def _claimed(self, missing: dict[int, Values], most: int, repeat: int) -> dict[int, Values]:
        """Takes up to ``most`` of the first candidates out of ``missing``, and those that others have driven."""
        first = dict(itertools.islice(missing.items(), max(most, _WINDOW)))
        if self.store.is_shared:
            known = self.store.known([repeated(values, repeat) for values in first.values()])
            for number, drive in zip(list(first), known, strict=True):
                if drive:
                    self.progress.count_other(drive)
                    del missing[number], first[number]
        claimed: dict[int, Values] = {}
        for number, values in first.items():
            if len(claimed) == most:
                break
            if self.store.claim(repeated(values, repeat)):
                claimed[number] = missing.pop(number)
        return claimed

    async def _round(self, candidates: dict[int, Values], repeat: int) -> None:
        folder = self.work / f"round-{min(candidates)}"
        jobs = self._jobs(candidates, folder)
        for job in jobs.values():
            shutil.rmtree(job.report, ignore_errors=True)  # what a killed search left of the same drive
        by_slug = {job.plan.slug: number for number, job in jobs.items()}
        runner = Runner(self.progress, self.backends, self.order, Policy(retries=RETRIES))

        def take(outcome: Outcome) -> Drive | None:
            if runner.interrupted:
                return None
            number = by_slug[outcome.slug]
            margin = worst_margin(outcome)
            point = repeated(candidates[number], repeat)
            drive = Drive(number, point, outcome.outcome, margin, outcome.reason, ",".join(failed_checks(outcome)))
            self.store.add(drive)
            if outcome.outcome == "passed":
                shutil.rmtree(jobs[number].report, ignore_errors=True)
            return drive

        self.progress.take, self.progress.repeat = take, repeat
        await runner.run(list(jobs.values()))
        end_like_interrupt()
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
        drives = self.report / self.folder
        return {n: Job(plans[slug], folder / slug, drives / slug, self.spec.slug) for n, slug in slugs.items()}
