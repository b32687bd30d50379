"""The child pipeline: a job a test, and what its jobs have in common."""

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dodo_dsl.plan.model import Plan, Suite, named, pooled
from dodo_dsl.spec.model import LEVELS
from dodo_dsl.spec.rig import SIMULATION_TAG

SPARE_MINUTES = 10
"""Beyond what a test may take: for images, set-up and report."""
MOST_JOBS = 500
"""Of a pipeline on gitlab.com's free tier: https://docs.gitlab.com/user/gitlab_com/#cicd"""
DEFAULT_TAGS = ("sil",)


@dataclass(frozen=True)
class JobOptions:
    """What jobs that occupy no rig have, as values of GitLab's keywords; an empty one is the runner's own.

    ``run_options`` are those of ``dodo run`` in each test, which a variable ``DODO_RUN_OPTIONS`` replaces. ``images``
    are those of the application that the parent has built, as lines ``DODO_IMAGE_<SERVICE>=<image>``.
    """

    tags: tuple[str, ...] = DEFAULT_TAGS
    image: str = ""
    services: tuple[str | Mapping[str, Any], ...] = ()
    before_script: str = ""
    run_options: str = ""
    images: tuple[str, ...] = ()


@dataclass(frozen=True)
class Job:
    """The job of a test, or of a test on any rig of a pool. ``tags`` are those of a rig's runner, else empty.

    ``rig`` is the resource that it locks; GitLab cannot lock one of several.
    """

    name: str
    stage: str
    minutes: int
    script: str
    is_gated: bool = False
    tags: tuple[str, ...] = ()
    rig: str = ""


@dataclass(frozen=True)
class Pipeline:
    """The stages in order, the jobs, and what all have in common; with ``pulls`` they log in to a registry first."""

    stages: tuple[str, ...]
    has_gate: bool
    pulls: bool
    jobs: tuple[Job, ...]
    options: JobOptions


def pipeline(suite: Suite, out: Path, options: JobOptions = JobOptions()) -> Pipeline:
    """The jobs of a suite that is written below ``out``, which jobs name by its last part where it is absolute."""
    levels = {plan.level for plan in suite.plans}
    has_gate = suite.gates and "hil" in levels and bool(levels & {"sil", "dil"})
    stages = [f"dodo-{level}" for level in LEVELS if level in levels] or ["dodo-sil"]
    if has_gate:
        stages.insert(-1, "dodo-gate")
    folder = out.name if out.is_absolute() else out.as_posix()
    jobs = tuple(_job(plans, has_gate, folder, "docker" if options.images else "") for plans in pooled(suite.plans))
    services = (service for plan in suite.plans for service in plan.application.services)
    pulls = bool(options.images) or any(service.process is None for service in services)
    return Pipeline(tuple(stages), has_gate, pulls, jobs, options)


def _job(plans: Sequence[Plan], has_gate: bool, folder: str, backend: str) -> Job:
    """The job of a test, of whose Plans there are several if any rig of a pool will do."""
    plan = plans[0]
    on_rig = plan.level == "hil" and plan.tag != SIMULATION_TAG
    shared = [tag for tag in plan.more_tags if all(tag in other.more_tags for other in plans)]
    seconds = max(p.timeout_s + sum(service.setup_s for service in p.services) for p in plans)
    words = ["dodo", "run", *(word for p in plans for word in ("--compiled", shlex.quote(f"{folder}/{p.slug}")))]
    words += ["--backend", backend] if backend else []
    return Job(
        name=named(plan).slug,
        stage=f"dodo-{plan.level}",
        minutes=math.ceil(seconds / 60) + SPARE_MINUTES,
        script=" ".join([*words, "--report dodo-report $DODO_RUN_OPTIONS"]),
        is_gated=has_gate and plan.level == "hil",
        tags=(plan.tag, *shared) if on_rig else (),
        rig=plan.rig if on_rig and not plan.pool else "",
    )
