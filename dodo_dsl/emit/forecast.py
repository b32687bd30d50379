"""How long a child pipeline will take with so many runners, from how long its tests took before."""

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dodo_dsl.emit.pipeline import Pipeline
from dodo_dsl.emit.pipeline_job import PipelineJob


@dataclass(frozen=True)
class Forecast:
    """Seconds until the last job has ended, seconds of all jobs together, and the job that ends last."""

    seconds: float
    work: float
    last: str


def forecast(pipeline: Pipeline, took: Callable[[str], float], runners: int, overhead: float) -> Forecast:
    """Jobs in their order, each to the first runner that is free.

    ``took`` gives a test's seconds by its slug; those of a job add up, and to them comes the ``overhead`` in s that a
    runner needs for any job.
    There are ``runners`` of the tag ``sil``, and one of each rig; of a pool, that which is free first takes the job.
    Jobs behind the gate wait for all others and for the gate, which is a job, too.
    """
    free: dict[str, list[float]] = {"": [0.0] * runners}
    before = [job for job in pipeline.jobs if not job.gated]
    behind = [job for job in pipeline.jobs if job.gated]
    ends = _ends(before, free, 0.0, took, overhead)
    if behind:
        opened = max(ends.values(), default=0.0) + overhead
        ends |= _ends(behind, free, opened, took, overhead)
    last = max(ends, key=lambda name: ends[name], default="")
    return Forecast(ends.get(last, 0.0), sum(_seconds(job, took) + overhead for job in pipeline.jobs), last)


def _seconds(job: PipelineJob, took: Callable[[str], float]) -> float:
    return sum(took(test) for test in job.tests)


def _ends(
    jobs: Sequence[PipelineJob],
    free: dict[str, list[float]],
    begin: float,
    took: Callable[[str], float],
    overhead: float,
) -> dict[str, float]:
    """When each job ends; ``free`` has for each rig, and for all other runners as "", when they are free again."""
    ends = {}
    for job in jobs:
        rigs = [free.setdefault(rig, [0.0]) for rig in job.pool or (job.rig,)]
        runners = min(rigs, key=lambda one: one[0])
        start = max(heapq.heappop(runners), begin)
        ends[job.name] = start + overhead + _seconds(job, took)
        heapq.heappush(runners, ends[job.name])
    return ends
