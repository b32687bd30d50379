"""The attempts at one test: again after an error, if wanted, with the reports of earlier ones kept."""

import asyncio
import contextlib
import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.added_services import PICTURES_FILE, RECORDING
from dodo_dsl.run.backends import Backends, Job
from dodo_dsl.run.engine import Engine
from dodo_dsl.run.outcomes import describe, error_outcome, error_reason, system_error
from dodo_dsl.run.rigs.pool import opened
from dodo_dsl.run.run_state import Standing

Phase = Callable[[str, str], None]
"""Shows what a test does, by its slug."""


class Attempts:
    """Runs jobs on backends, and again up to ``retries`` times after an error, unless ``stopped``."""

    def __init__(
        self,
        backends: Backends,
        phase: Phase,
        retries: int,
        keep: bool,
        stopped: Callable[[], bool],
        standing: Callable[[str, Standing], None],
    ) -> None:
        self.kept: list[str] = []
        """Sentences on the tests that were left running."""
        self._backends, self._phase, self._retries, self._keep = backends, phase, retries, keep
        self._stopped, self._standing = stopped, standing
        self._made: dict[str, int] = {}

    async def outcome(self, job: Job, alone: bool = False) -> Outcome:
        """That of the last attempt; earlier ones are kept in the report, too.

        What a busy machine left undecided is tried again when the test is ``alone``, and not at once.
        """
        notes: tuple[str, ...] = ()
        for left in range(self._retries, -1, -1):
            outcome = await self._attempt(job)
            is_over = outcome.outcome != "error" or (is_undecided(outcome) and not alone)
            if is_over or self._stopped() or not left:
                break
            notes = (*notes, f"attempt {self._made[job.plan.slug]} ended in error: {outcome.reason}")
            if problem := self.set_aside(job):
                notes = (*notes, f"not retried, {problem}")
                break
            self._phase(job.plan.slug, f"retrying after error: {outcome.reason}")
        return replace(outcome, notes=(*notes, *outcome.notes))

    def set_aside(self, job: Job) -> str:
        """Moves the report of the last attempt to those of earlier ones; why it cannot be, or an empty text."""
        try:
            set_aside(job.report, self._made[job.plan.slug])
        except OSError as error:
            return f"because its report cannot be moved: {system_error(error)}"
        return ""

    async def _attempt(self, job: Job) -> Outcome:
        slug, outcome = job.plan.slug, None
        self._made[slug] = self._made.get(slug, 0) + 1
        say, stands = functools.partial(self._phase, slug), functools.partial(self._standing, slug)

        def forget_pictures() -> None:
            with contextlib.suppress(OSError):
                (job.report / PICTURES_FILE).unlink(missing_ok=True)

        try:
            async with opened(job, say, lambda one: self._backends.open(one, say, self._keep)) as (chosen, backend):
                engine = Engine(chosen.plan, backend, say, stands, forget_pictures)
                outcome, kept = await engine.run(self._keep)
                self.kept.extend(kept)
                if (
                    engine.state.finding.cause == "silence"
                    and not self._keep
                    and (why := await asyncio.to_thread(_silent, job))
                ):
                    outcome = replace(outcome, reason=f"{outcome.reason}; {why}")
                if job.plan.pool:
                    outcome = replace(outcome, notes=(*outcome.notes, f"ran on rig '{chosen.plan.rig}'"))
        except Exception as error:  # noqa: BLE001  (whatever it is, it concerns this test alone)
            if outcome is None:
                return error_outcome(job.plan, self._backends.name, error_reason(error, job.report))
            return replace(
                outcome, notes=(*outcome.notes, f"not all of the test was taken down: {describe(error, job.report)}")
            )
        if outcome.outcome == "passed" and not self._keep:
            forget_pictures()
        return outcome


def _silent(job: Job) -> str:
    """Which program of the application is to blame that it did not answer; empty if that is not known."""
    from dodo_dsl.opendlv.odvd import OdvdError
    from dodo_dsl.run.test_recording import silent_consumer

    with contextlib.suppress(OSError, OdvdError):
        return silent_consumer(job.plan, job.folder, job.report / RECORDING)
    return ""


def is_undecided(outcome: Outcome) -> bool:
    """Whether the machine was too busy to judge."""
    return outcome.machine is not None and outcome.machine.undecided


def set_aside(report: Path, attempt: int) -> None:
    """Moves what an attempt reported into ``attempts/<number>`` of the same folder."""
    if not report.is_dir():
        return
    target = report / "attempts" / str(attempt)
    target.mkdir(parents=True)
    for entry in report.iterdir():
        if entry.name != "attempts":
            entry.rename(target / entry.name)
