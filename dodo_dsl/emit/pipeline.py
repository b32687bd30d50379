"""The child pipeline: one job per instance or per batch, and GitLab's limits for it."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dodo_dsl.diagnostics import Diagnostic, Severity, Span
from dodo_dsl.emit.pipeline_jobs import NO_OPTIONS, SPARE_MINUTES, JobOptions, PipelineJob, packed
from dodo_dsl.plan.model import Plan, Suite
from dodo_dsl.plan.runs import by_test, named, pooled
from dodo_dsl.plan.test_files import FileCopy
from dodo_dsl.spec.model import LEVELS
from dodo_dsl.spec.rig import SIMULATION_TAG

if TYPE_CHECKING:
    from dodo_dsl.plan.build import Compiled


CHILD = "child.gitlab-ci.yml"
RULE = "pipeline-limit"

MAX_JOBS_FREE = 500
MAX_JOBS_PARSED = 1700
_MOST_NAMED = 3
_ARTIFACT_HINT = (
    "let the jobs take them from the repository or Git LFS with --files repository, or shorten recordings with "
    "'dodo rec cut'; where GitLab's administrator allows more, give its limit with --artifact-limit"
)


@dataclass(frozen=True)
class Pipeline:
    """The stages in order, whether a gate precedes hil, the variables, and the jobs with what they have in common."""

    stages: tuple[str, ...]
    gate: bool
    variables: dict[str, str]
    jobs: tuple[PipelineJob, ...]
    options: JobOptions = NO_OPTIONS


def pipeline_folder(out: Path) -> str:
    """The output folder as a pipeline's jobs name it: as it was given, or its last part when that is absolute."""
    return out.name if out.is_absolute() else out.as_posix()


def pipeline(suite: Suite, folder: str, options: JobOptions = NO_OPTIONS) -> Pipeline:
    """The jobs of a suite; ``folder`` is the output folder's name, as the parent's artifact has it."""
    levels = {plan.level for plan in suite.plans}
    gate = _gated(suite)
    stages = [stage for stage in LEVELS if stage in levels]
    if gate:
        stages.insert(stages.index("hil"), "gate")
    if not stages:
        stages.append("test")  # GitLab refuses a pipeline without a job
    jobs = tuple(_job(plans, gate, folder, options) for plans in pooled(suite.plans))
    if options.most_jobs:
        timeouts = {plan.slug: plan.timeout_s for plan in by_test(suite.plans)}
        jobs = packed(jobs, options.most_jobs, {**timeouts, **options.seconds})
    return Pipeline(tuple(stages), gate, _variables(suite, options), jobs, options)


def _variables(suite: Suite, options: JobOptions) -> dict[str, str]:
    """Those that a parent has not set for its child."""
    pulls = options.images or any(_needs_images(plan) for plan in suite.plans)
    wanted = {"DODO_REGISTRY": "$CI_REGISTRY" if pulls else "", "DODO_RUN_OPTIONS": options.run_options}
    return {name: value for name, value in wanted.items() if value}


def _gated(suite: Suite) -> bool:
    levels = {plan.level for plan in suite.plans}
    return suite.gates and "hil" in levels and bool(levels & {"sil", "dil"})


def _needs_images(plan: Plan) -> bool:
    return any(service.process is None for service in plan.application.services)


def _job(plans: Sequence[Plan], gate: bool, folder: str, options: JobOptions) -> PipelineJob:
    """The job of a test, of whose Plans there are several if any rig of a pool will do."""
    plan, rig = plans[0], plans[0].rig
    on_rig = plan.level == "hil" and plan.tag != SIMULATION_TAG
    shared = [tag for tag in plan.more_tags if all(tag in other.more_tags for other in plans)]
    return PipelineJob(
        name=named(plan).slug,
        stage=plan.level,
        tags=(plan.tag, *shared) if on_rig else (),
        gated=gate and plan.level == "hil",
        rig=rig if on_rig and not plan.pool else "",
        pool=tuple(one.rig for one in plans) if on_rig and plan.pool else (),
        minutes=max(math.ceil((p.timeout_s + sum(s.setup_s for s in p.services)) / 60) for p in plans) + SPARE_MINUTES,
        tests=(named(plan).slug,),
        folders=tuple(f"{folder}/{one.slug}" for one in plans),
        backend=options.backend,
    )


def pipeline_problems(suite: Suite, child: Pipeline) -> Iterator[Diagnostic]:
    """What GitLab would refuse in the child pipeline of a suite, at the test with the largest share.

    The number of jobs of a pipeline is unlimited on a self-managed GitLab
    unless an administrator limits it, and 500, 1,500 or 2,000 on gitlab.com, by its tier. A YAML file may take 2 MB of
    memory when parsed (``max_yaml_size_bytes``); a job takes 0.7 to 1.2 kB of that in Ruby, as GitLab counts before it
    looks at what jobs extend. All limits can be raised, so numbers of jobs are warnings.

    Sources: https://docs.gitlab.com/administration/cicd/limits/ and
    https://docs.gitlab.com/user/gitlab_com/#cicd
    """
    jobs = len(child.jobs) + child.gate
    hint = "pack them into fewer with --jobs, compile fewer tests into one pipeline, or a smaller 'matrix'"
    if jobs > MAX_JOBS_PARSED:
        message = f"the child pipeline has {jobs} jobs, which take more than the 2 MB that GitLab reads by default"
        yield _largest(suite, message, f"{hint}; an administrator can raise max_yaml_size_bytes", "warning")
    elif jobs > MAX_JOBS_FREE:
        message = f"the child pipeline has {jobs} jobs, gitlab.com allows 500 on its free tier and 1500 on Premium"
        yield _largest(suite, message, f"{hint}; a self-managed GitLab allows any number by default", "warning")


def artifact_problems(compiled: "Compiled", options: JobOptions) -> list[Diagnostic]:
    """A warning if the files of all tests together are larger than the artifact of the parent may be.

    GitLab accepts 100 MB (``max_artifacts_size``) unless an administrator allows more, and gitlab.com 1 GB. It counts
    what is packed, which recordings of frames hardly become smaller by. Sources as of ``pipeline_problems``.
    """
    if not options.artifact_mb:
        return []
    carried: dict[str, tuple[FileCopy, str]] = {}
    for slug, copies in compiled.copies.items():
        for copy in copies:
            if not copy.is_linked:
                carried.setdefault(copy.shared or f"{slug}/{copy.target}", (copy, slug))
    sizes = {source: source.stat().st_size for source in {copy.source for copy, _ in carried.values()}}
    total = sum(sizes[copy.source] for copy, _ in carried.values())
    if total <= options.artifact_mb << 20:
        return []
    largest = sorted(carried.values(), key=lambda one: (-sizes[one[0].source], one))[:_MOST_NAMED]
    plan = next(plan for plan in compiled.suite.plans if plan.slug == largest[0][1])
    named = [f"{copy.target} ({sizes[copy.source] / (1 << 20):.0f} MB)" for copy, _ in largest]
    message = (
        f"the artifact with the tests has {total / (1 << 20):.0f} MB of files before it is packed, more than "
        f"{options.artifact_mb} MB; the largest: {', '.join(named)}"
    )
    return [Diagnostic(_place(plan), RULE, message, _ARTIFACT_HINT, "warning")]


def _largest(suite: Suite, message: str, hint: str, severity: Severity) -> Diagnostic:
    """The problem of a whole suite, at the spec with the most instances, the first of several."""
    (spec, number), *_ = Counter(plan.spec for plan in suite.plans).most_common(1)
    plan = next(plan for plan in suite.plans if plan.spec == spec)
    whose = f"{message} ({number} of this test)" if number > 1 else message
    return Diagnostic(_place(plan), RULE, whose, hint, severity)


def _place(plan: Plan) -> Span:
    place = plan.source_map.get("matrix") or plan.source_map.get("name")
    return Span(place.file, place.line, place.column) if place else Span(plan.spec)
