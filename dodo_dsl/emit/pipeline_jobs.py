"""Jobs of the child pipeline: one a test, or fewer for many tests, and what the parent pipeline wants of all of them.

Tests share jobs in suites whose jobs cost more to begin than to run.
"""

import heapq
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from dodo_dsl.spec.model import LEVELS

SPARE_MINUTES = 10
"""Beyond what its tests may take."""


@dataclass(frozen=True)
class PipelineJob:
    """``rig`` is the resource that it locks, empty for any other runner; ``tags`` are those of a rig's.

    ``pool`` has the names of the rigs of which it takes any; GitLab cannot lock one of several.

    It runs the compiled ``tests``, slugs, in ``folders`` as the parent's artifact has them.
    """

    name: str
    stage: str
    gated: bool
    rig: str
    minutes: int
    tests: tuple[str, ...]
    folders: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    pool: tuple[str, ...] = ()
    backend: str = ""
    """What the tests run on unless the options of a pipeline name another; empty for dodo's own choice."""

    @property
    def on_rig(self) -> bool:
        """Whether a rig's own runner takes it, and not those of all other jobs."""
        return bool(self.rig or self.pool)

    @property
    def script(self) -> str:
        compiled = " ".join(f"--compiled {shlex.quote(folder)}" for folder in self.folders)
        backend = f" --backend {self.backend}" if self.backend else ""
        alone = self.on_rig and len(self.tests) > 1  # else they would wait for each other's lease
        jobs = " --jobs 1" if alone else ""
        return f"dodo run {compiled}{backend} --report dodo-report $DODO_RUN_OPTIONS{jobs}"


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


DEFAULT_TAGS = ("sil",)


@dataclass(frozen=True)
class JobOptions:
    """``tags`` of the runners of all jobs that occupy no rig, and their ``image``; empty for the runner's own.

    ``services`` are theirs, too, and ``before_script`` are their first commands; ``artifacts_access`` says who may
    download what any job keeps, empty for all. Values are those of GitLab's keywords.

    ``run_options`` are those of ``dodo run`` in each test, which a variable ``DODO_RUN_OPTIONS`` replaces. ``images``
    are those of the application that the parent has built, as lines ``DODO_IMAGE_<SERVICE>=<image>``. Where
    ``most_jobs`` is not 0, tests share so many jobs, evenly by ``seconds`` of each slug, or else by their timeouts.
    Jobs have large files ``from_repository``, as they check it out, or else from the artifact of the parent, which may
    have ``artifact_mb`` MB; 0 for any number.
    """

    tags: tuple[str, ...] = DEFAULT_TAGS
    image: str = ""
    run_options: str = ""
    images: tuple[str, ...] = ()
    most_jobs: int = 0
    seconds: Mapping[str, float] = field(default_factory=dict)
    services: tuple[str | Mapping[str, Any], ...] = ()
    before_script: str = ""
    artifacts_access: str = ""
    from_repository: bool = False
    artifact_mb: int = 0

    @property
    def backend(self) -> str:
        """Images that were built are what is tested, even if the application could run as processes."""
        return "docker" if self.images else ""


NO_OPTIONS = JobOptions()
