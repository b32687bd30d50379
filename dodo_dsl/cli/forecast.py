"""Forecasts in words, from the history of this machine: how many tests a run has at a time, and how long it takes."""

import functools
from collections.abc import Callable, Sequence

from dodo_dsl.cli import progress
from dodo_dsl.run.backends import Job
from dodo_dsl.run.history import History
from dodo_dsl.run.schedule import Schedule


def at_once(order: Schedule, jobs: Sequence[Job]) -> str:
    """How many tests run at a time, in words."""
    most = min(order.capacity // min(order.need(job) for job in jobs), len(jobs))
    return f"{'up to ' * (len(jobs) > 1)}{max(most, 1)} at a time"


def run_forecast(order: Schedule, jobs: Sequence[Job], backend: str) -> str:
    """How long the run will take, in words; a test without history may take its whole timeout."""
    history = History()
    known = all(history.seconds(j.plan.spec, j.test, backend, j.plan.clock) is not None for j in jobs)
    seconds = order.forecast(order.ordered(jobs))
    return progress.about(seconds) if known else progress.about(seconds).replace("about", "at most")


def expectation(backend: str) -> Callable[[Job], float]:
    """How long a job takes according to the history; an unknown one may take its whole timeout."""
    history = History()

    @functools.cache
    def known(spec: str, test: str, clock: str) -> float | None:
        return history.seconds(spec, test, backend, clock)

    def expected(job: Job) -> float:
        seconds = known(job.plan.spec, job.test, job.plan.clock)
        return job.plan.timeout_s if seconds is None else seconds

    return expected
