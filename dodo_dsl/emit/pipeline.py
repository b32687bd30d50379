"""The child pipeline: one job per instance, and GitLab's limits for it."""

import math
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from dodo_dsl.diagnostics import Diagnostic, Severity, Span
from dodo_dsl.plan.model import Plan, Suite
from dodo_dsl.spec.deployment.rig import EMULATED
from dodo_dsl.spec.model import LEVELS

CHILD = "child.gitlab-ci.yml"
RULE = "pipeline-limit"

MAX_NAME = 255
MAX_BYTES = 5 << 20
MAX_JOBS_FREE = 500
MAX_JOBS_PARSED = 850

_SPARE_MINUTES = 10
_SEARCH_OPTIONS = '--study "$CI_PIPELINE_ID" --report dodo-search $DODO_SEARCH_OPTIONS'


@dataclass(frozen=True)
class PipelineJob:
    """A job of the child pipeline; ``rig`` is the resource that it locks, or empty."""

    name: str
    stage: str
    tag: str
    gated: bool
    rig: str
    minutes: int
    interruptible: bool
    script: str


@dataclass(frozen=True)
class SearchJobs:
    """A test that ``workers`` jobs search together, and the compose files of its application, as a job names them."""

    test: str
    slug: str
    workers: int
    application: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """No test's name has a space."""
        return f"search {self.slug}"

    @property
    def script(self) -> str:
        files = "".join(f" --application {shlex.quote(file)}" for file in self.application)
        return f'dodo search {shlex.quote(self.test)}{files} --storage "$DODO_SEARCH_STORAGE" {_SEARCH_OPTIONS}'


@dataclass(frozen=True)
class Pipeline:
    """The stages in order, whether a gate precedes hil, whether images are pulled, and the jobs."""

    stages: tuple[str, ...]
    gate: bool
    images: bool
    jobs: tuple[PipelineJob, ...]
    searches: tuple[SearchJobs, ...] = ()


def pipeline(suite: Suite, folder: str, searches: Sequence[SearchJobs] = ()) -> Pipeline:
    """The jobs of a suite; ``folder`` is the output folder's name, as the parent's artifact has it."""
    levels = {plan.level for plan in suite.plans}
    gate = _gated(suite)
    stages = [stage for stage in LEVELS if stage in levels]
    if gate:
        stages.insert(stages.index("hil"), "gate")
    if searches:
        stages.append("search")
    jobs = tuple(_job(plan, gate, folder) for plan in suite.plans)
    return Pipeline(tuple(stages), gate, any(_needs_images(plan) for plan in suite.plans), jobs, tuple(searches))


def _gated(suite: Suite) -> bool:
    levels = {plan.level for plan in suite.plans}
    return suite.gates and "hil" in levels and bool(levels & {"sil", "dil"})


def _needs_images(plan: Plan) -> bool:
    return any(service.process is None for service in plan.application.services)


def _job(plan: Plan, gate: bool, folder: str) -> PipelineJob:
    rig = plan.rig
    real = plan.level == "hil" and rig != EMULATED
    return PipelineJob(
        name=plan.slug,
        stage=plan.level,
        tag=plan.tag,
        gated=gate and plan.level == "hil",
        rig=rig if real else "",
        minutes=math.ceil((plan.timeout_s + sum(s.setup_s for s in plan.services)) / 60) + _SPARE_MINUTES,
        interruptible=not real,
        script=f"dodo run --compiled {shlex.quote(f'{folder}/{plan.slug}')} --report dodo-report $DODO_RUN_OPTIONS",
    )


def pipeline_problems(suite: Suite, text: str, searches: Sequence[SearchJobs] = ()) -> list[Diagnostic]:
    """What GitLab would refuse in the child pipeline ``text`` of a suite, at the test with the largest share.

    A job's name has at most 255 characters. The archive of an artifact that holds the YAML of a child pipeline has at
    most 5 MB (``max_artifacts_content_include_size``). The number of jobs of a pipeline is unlimited on a self-managed
    GitLab unless an administrator limits it, and 500, 1,500 or 2,000 on gitlab.com, by its tier. A YAML file may take
    2 MB of memory when parsed (``max_yaml_size_bytes``); a job takes 2.3 to 2.4 kB of that in Ruby. All limits but the
    first can be raised, so numbers of jobs are warnings. A job's limit of 50 ``needs`` is never reached: the job
    ``gate`` represents all tests before it.

    Sources: https://docs.gitlab.com/administration/cicd/limits/ and
    https://docs.gitlab.com/user/gitlab_com/#cicd
    """
    return [*_names(suite), *_whole(suite, text, sum(search.workers + 1 for search in searches))]


def _names(suite: Suite) -> Iterator[Diagnostic]:
    for plan in suite.plans:
        if len(plan.slug) > MAX_NAME:
            message = f"the job '{plan.slug[:40]}...' has a name of {len(plan.slug)} characters, more than {MAX_NAME}"
            yield Diagnostic(_place(plan), RULE, message, "shorten the test's name, or the keys and values of 'matrix'")


def _whole(suite: Suite, text: str, more: int) -> Iterator[Diagnostic]:
    """Problems of all jobs together; ``more`` are those that run no single test."""
    jobs, size = len(suite.plans) + _gated(suite) + more, len(text.encode())
    hint = "compile fewer tests into one pipeline, or a smaller 'matrix'"
    if size > MAX_BYTES:
        message = f"the child pipeline has {size / (1 << 20):.1f} MB, GitLab accepts 5 MB"
        yield _largest(suite, message, hint, "error")
    if jobs > MAX_JOBS_PARSED:
        message = f"the child pipeline has {jobs} jobs, which take more than the 2 MB that GitLab reads by default"
        yield _largest(suite, message, f"{hint}; an administrator can raise max_yaml_size_bytes", "warning")
    elif jobs > MAX_JOBS_FREE:
        message = f"the child pipeline has {jobs} jobs, gitlab.com allows 500 on its free tier and 1500 on Premium"
        yield _largest(suite, message, f"{hint}; a self-managed GitLab allows any number by default", "warning")


def _largest(suite: Suite, message: str, hint: str, severity: Severity) -> Diagnostic:
    """The problem of a whole suite, at the spec with the most instances, the first of several."""
    (spec, number), *_ = Counter(plan.spec for plan in suite.plans).most_common(1)
    plan = next(plan for plan in suite.plans if plan.spec == spec)
    whose = f"{message} ({number} of this test)" if number > 1 else message
    return Diagnostic(_place(plan), RULE, whose, hint, severity)


def _place(plan: Plan) -> Span:
    place = plan.source_map.get("matrix") or plan.source_map.get("name")
    return Span(place.file, place.line, place.column) if place else Span(plan.spec)
