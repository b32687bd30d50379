"""Tests of a pipeline in fewer jobs, for suites whose jobs cost more to begin than to run."""

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import replace

from dodo_dsl.emit.pipeline_job import SPARE_MINUTES, PipelineJob
from dodo_dsl.spec.model import LEVELS


def packed(jobs: Sequence[PipelineJob], most: int, seconds: Mapping[str, float]) -> tuple[PipelineJob, ...]:
    """The same tests in at most ``most`` jobs that may run at once, and one for each rig and each pool of rigs.

    Each test goes, the longest first, to the job that has least to do (LPT). ``seconds`` has how long each takes. Tests
    behind the gate are not mixed with those before it, and tests of one rig with no others. A job of one test keeps
    its name; that of others has a space, and the name of no test has.
    """
    alike: dict[tuple[bool, str, tuple[str, ...]], list[PipelineJob]] = {}
    for job in jobs:
        alike.setdefault((job.gated, job.rig, job.pool), []).append(job)
    made: list[PipelineJob] = []
    for (gated, rig, pool), group in alike.items():
        shares = _shares(group, 1 if rig or pool else most, seconds)
        for number, share in enumerate(shares, 1):
            on_rig = f"rig {rig}" if rig else f"rig {' or '.join(pool)}" if pool else ""
            name = on_rig or f"{'hil' if gated else 'tests'} {number}/{len(shares)}"
            made.append(_joined(share, name) if len(share) > 1 else share[0])
    return tuple(made)


def _shares(group: Sequence[PipelineJob], most: int, seconds: Mapping[str, float]) -> list[list[PipelineJob]]:
    """The jobs of a group by the job that takes them, each share in the order of the group."""
    shares: list[list[int]] = [[] for _ in range(min(most, len(group)))]
    loads = [(0.0, 0, number) for number in range(len(shares))]  # seconds, and tests: those of no time are shared, too
    for index in sorted(range(len(group)), key=lambda index: -seconds[group[index].name]):
        load, tests, number = heapq.heappop(loads)
        shares[number].append(index)
        heapq.heappush(loads, (load + seconds[group[index].name], tests + 1, number))
    return [[group[index] for index in sorted(share)] for share in shares]


def _joined(share: Sequence[PipelineJob], name: str) -> PipelineJob:
    return replace(
        share[0],
        name=name,
        stage=max((job.stage for job in share), key=LEVELS.index),
        minutes=sum(job.minutes - SPARE_MINUTES for job in share) + SPARE_MINUTES,
        folders=tuple(folder for job in share for folder in job.folders),
        tests=tuple(test for job in share for test in job.tests),
    )
