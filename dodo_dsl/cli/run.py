"""dodo run: run tests and judge the application."""

import argparse
import asyncio
import contextlib
import gc
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TextIO, cast

from dodo_dsl.cli import progress, run_report, selection
from dodo_dsl.cli.display import Verbosity
from dodo_dsl.cli.errors import Exit, UsageError, of_outcomes
from dodo_dsl.cli.loading import loading
from dodo_dsl.cli.numbers import positive, seconds, seed, shard
from dodo_dsl.cli.provenance import Origin, origin, recording
from dodo_dsl.cli.report import REPORT
from dodo_dsl.cli.run_jobs import prepare
from dodo_dsl.cli.run_report import save_report
from dodo_dsl.cli.uninterrupted import UninterruptedStream, more_descriptors, signals_interrupt, undisturbed
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.report.next_report import next_report
from dodo_dsl.report.overview import Past
from dodo_dsl.report.repetitions import repeated
from dodo_dsl.report.report_folder import draw_test
from dodo_dsl.report.results import Circumstances, GivenReport
from dodo_dsl.run.backends import COMBINATIONS, CombinedBackends, Job
from dodo_dsl.run.history import History, typical_s
from dodo_dsl.run.process.fork_server import ForkServer
from dodo_dsl.run.process.side import may_enter
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.runner import BackendName, Runner, default_backend
from dodo_dsl.run.schedule import Schedule
from dodo_dsl.run.work_folder import WorkFolder, reap_folders, work_folder
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.model import CLOCKS, LEVELS
from dodo_dsl.terminal import printable

_LATEST = 20
"""Runs of a test that its page shows."""


def choose_backend(plans: Sequence[Plan]) -> BackendName:
    """Process where the application allows that backend; mixed on rigs and without DoDo's images; else docker."""
    by_application = default_backend(plans)
    if by_application == "process":
        return by_application
    if any(plan.is_real for plan in plans) or (may_enter() and _lacks_images(plans)):
        return "mixed"
    return by_application


def _lacks_images(plans: Sequence[Plan]) -> bool:
    """Whether an engine of this machine lacks an image of DoDo's."""
    from docker.errors import DockerException, ImageNotFound

    from dodo_dsl.run.docker.client import connect

    try:
        client = connect()
        if not client.api.base_url.startswith("http+docker:"):
            return False
        for image in {service.image for plan in plans for service in plan.services}:
            client.api.inspect_image(image)
    except ImageNotFound:
        return True
    except (BackendError, DockerException, OSError):
        return False
    return False


EXAMPLES = """examples:
  dodo run                                     all tests of dodo.yml
  dodo run sil-closed-straight                 one test
  dodo run 'sil-*' -j 4                        by pattern, four at a time
  dodo run --application ../app/docker-compose.yml --level sil
  dodo run 'sil-*' --repeat 20 --fail-fast     how often they pass, until one does not
  dodo run sil-closed-straight --repeat 2      in lockstep: whether both runs have the same values
  dodo run sil-closed-straight --samples 16    at 16 values of its ranges, the same ones for each --seed
  dodo run -q                                  only what did not pass, and the counts
  dodo run --shard 2/4                         the second of four parts, for jobs that share the tests
  dodo run --compiled generated/sil-closed-straight --report dodo-report

exit codes: 0 all passed, 1 some failed, or repetitions in lockstep differ, 2 wrong usage or spec, 3 some ended in
error, 130 interrupted
"""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("test", nargs="*", metavar="TEST", help="names, patterns, specs or folders (default: all)")
    parser.add_argument(
        "--level",
        action="append",
        choices=LEVELS,
        default=[],
        help="only tests of this level: software, data or hardware in the loop; repeatable",
    )
    parser.add_argument(
        "--backend",
        choices=tuple(COMBINATIONS),
        help="where services run; mixed: the application in containers, DoDo's own as processes (default: process, if "
        "the application allows it; else mixed on a rig, or where DoDo's images are missing; else docker)",
    )
    parser.add_argument(
        "-j", "--jobs", type=positive, metavar="N", help="concurrent tests (default: as many as the cores allow)"
    )
    parser.add_argument("--shard", type=shard, default=(1, 1), metavar="I/N",
                        help="run part I of N parts of the tests, such as 2/4 (default: all)")  # fmt: skip
    parser.add_argument("--clock", choices=tuple(CLOCKS), help="override the specs' clock")
    parser.add_argument("--wall-timeout", type=seconds, metavar="S", help="maximum wall time of a test in lockstep")
    parser.add_argument("--isolation", choices=("network", "host"), help="override the specs' isolation")
    parser.add_argument("--emulate", action="store_true", help="take emulated rigs, also in place of those of dodo.yml")
    parser.add_argument(
        "--report", type=Path, default=REPORT, metavar="DIR", help="folder of the report (default: dodo-report)"
    )
    parser.add_argument("--seed", type=seed, metavar="N", help="override the specs' seed")
    parser.add_argument("--repeat", type=positive, default=1, metavar="N",
                        help="run every test N times; in lockstep, say which values differ")  # fmt: skip
    parser.add_argument("--samples", type=positive, metavar="N",
                        help="run each test with 'vary' at N values of its ranges")  # fmt: skip
    parser.add_argument("--fail-fast", action="store_true", help="start no further test after one that did not pass")
    parser.add_argument("--retry-errors", type=positive, nargs="?", const=1, default=0, metavar="N",
                        help="rerun a test in error, alone and last, up to N times (default without N: 1)")  # fmt: skip
    parser.add_argument("--compiled", type=Path, action="append", default=[], metavar="DIR/SLUG",
                        help="folder of a compiled test; repeatable")  # fmt: skip
    parser.add_argument("--keep", action="store_true", help="leave everything running, and show how to inspect it")
    parser.set_defaults(verbosity=Verbosity.NORMAL)
    group = parser.add_mutually_exclusive_group()
    group.add_argument("-q", "--quiet", dest="verbosity", action="store_const", const=Verbosity.QUIET,
                       help="print only warnings, what did not pass, and a last line with the counts")  # fmt: skip
    group.add_argument("-v", "--verbose", dest="verbosity", action="store_const", const=Verbosity.VERBOSE,
                       help="print each test's phases, sentence, checks, and what the application used")  # fmt: skip
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    with signals_interrupt():
        return _main(options, stdout)


def _main(options: argparse.Namespace, stdout: TextIO) -> int:
    more_descriptors()
    stdout = cast(TextIO, UninterruptedStream(stdout))
    reap_folders()
    with work_folder() as folder, loading(options) as server:
        jobs, deployment = prepare(options, folder.path, stdout)
        if not jobs:
            stdout.write("no test is in this part of the tests\n")
            return Exit.OK
        _refuse_to_keep([job.plan for job in jobs] if options.keep else [])
        runner = runner_of(options, jobs, deployment, stdout, folder, server)
        gc.freeze()
        gc.enable()
        source, said = origin(options, deployment), options.verbosity
        is_part = bool(options.test or options.level or options.compiled or options.shard != (1, 1))
        registry = () if options.compiled else deployment.registry
        names = [job.plan.name for job in jobs]
        others = run_report.earlier(options.report, names, registry) if is_part else None
        outcomes, is_reported, repeats = run(runner, jobs, options.report, stdout, source, others, said)
        if runner.kept:
            stdout.write("\n".join(["", *runner.kept, ""]))
            folder.kept = True
    differs = Exit.PROBLEMS if any(repeats.values()) else Exit.OK
    return max(_exit_code(outcomes, runner.interrupted), differs, Exit.OK if is_reported else Exit.ERROR)


def _refuse_to_keep(plans: Sequence[Plan]) -> None:
    for plan in plans:
        if plan.is_real:
            raise UsageError(
                f"{plan.name} runs on rig '{plan.rig}', which --keep would leave in motion: run it without --keep"
            )


def runner_of(
    options: argparse.Namespace,
    jobs: Sequence[Job],
    deployment: Deployment,
    stdout: TextIO,
    folder: WorkFolder,
    server: ForkServer | None,
) -> Runner:
    plans = [job.plan for job in jobs]
    backend = options.backend or choose_backend(plans)
    history = History()
    order = Schedule(options.jobs, lambda j: typical_s(history.of(j.plan.spec, j.test, backend, j.plan.clock)))
    most = max(1, min(order.capacity // min(order.need(job) for job in jobs), len(jobs)))
    at_once = f"{'up to ' * (len(jobs) > 1)}{most} at a time"
    if options.verbosity is not Verbosity.QUIET:
        stdout.write(f"{progress.count(len(jobs))}, {at_once}, {backend} backend\n")
    shown = progress.choose(stdout, [p.slug for p in plans], options.verbosity)
    _require_possible(options, backend, plans)
    cids, nets, held = deployment.cids, [str(deployment.subnets)], (folder.lease.descriptor,)
    backends = CombinedBackends(backend, cids, nets, options.isolation, held, server)
    fail_fast, retries = options.fail_fast, options.retry_errors
    return Runner(shown, backends, order, fail_fast=fail_fast, retries=retries, keep=options.keep)


def _require_possible(options: argparse.Namespace, backend: str, plans: Sequence[Plan]) -> None:
    if backend == "process":
        without = sorted({s.name for p in plans for s in p.application.services if not s.process})
        if without:
            advice = "add for example 'x-dodo-process: [python, main.py]', or run with --backend mixed or docker"
            raise UsageError(
                f"application service '{without[0]}' has no 'x-dodo-process', which the process backend needs; {advice}"
            )
    elif options.compiled and any(options.isolation not in (None, plan.isolation) for plan in plans):
        raise UsageError(f"this test is compiled for isolation {plans[0].isolation}; compile it again for another")


def run(
    runner: Runner,
    jobs: Sequence[Job],
    report: Path,
    stdout: TextIO,
    source: Origin,
    others: GivenReport | None = None,
    said: Verbosity = Verbosity.NORMAL,
) -> tuple[list[Outcome], bool, dict[str, list[str]]]:
    """The outcomes, whether the report holds all of them, and what differs between repetitions; all are printed.

    ``others`` are tests that did not run again and stay in the report.
    """
    slugs = [job.plan.slug for job in jobs]
    with recording(source) as record, next_report(report.resolve(), slugs, in_place=runner.keep) as target:
        jobs = [replace(job, report=target.folder / job.plan.slug) for job in jobs]
        drawn = list[Future[list[str]]]()
        with ThreadPoolExecutor(1, "drawing") as pool, runner.progress:  # beside the tests that still run

            def draw(job: Job, outcome: Outcome) -> None:
                drawn.append(pool.submit(draw_test, target.folder, outcome, job.plan, job.folder))

            with contextlib.closing(runner.backends):
                outcomes = asyncio.run(runner.run(jobs, draw))
        plans = {job.plan.slug: job.plan for job in jobs}
        about = {s: run_report.Reported(p, target.folder / s, report / s) for s, p in plans.items()}
        run_report.write_summary(stdout, outcomes, runner.not_run, said, about)
        ran = {job.plan.slug: job for job in jobs}
        repeats = repeated((ran[o.slug].folder, o, ran[o.slug].report) for o in outcomes)
        for slug, lines in repeats.items():
            if lines or said is not Verbosity.QUIET:
                same = "differ" if lines else "have the same values"
                stdout.write(f"{slug}: the runs in lockstep {same}\n")
                stdout.writelines(f"        {printable(line)}\n" for line in lines)
        stdout.flush()
        with undisturbed():
            circumstances = Circumstances((record(),), tuple(runner.not_run))
            problems = [problem for each in drawn for problem in each.result()]
            sentence, is_whole = save_report(target, report, outcomes, others, circumstances, _past(jobs, outcomes))
    stdout.writelines(f"{printable(problem)}\n" for problem in problems)
    if said is not Verbosity.QUIET or not is_whole:
        stdout.write(f"{sentence}\n")
    return outcomes, is_whole, repeats


def _past(jobs: Sequence[Job], outcomes: Sequence[Outcome]) -> Past:
    """The latest runs of these tests, whose outcomes are added to them."""
    history, tests = History(), {job.plan.slug: job.test for job in jobs}
    history.add((tests[o.slug], o) for o in outcomes)
    latest = {o.slug: history.of(o.spec, tests[o.slug], o.backend, o.clock)[-_LATEST:] for o in outcomes}
    return {slug: [(run.outcome, run.in_words()) for run in runs] for slug, runs in latest.items()}


def _exit_code(outcomes: Sequence[Outcome], interrupted: bool) -> Exit:
    return Exit.INTERRUPTED if interrupted else of_outcomes(outcome.outcome for outcome in outcomes)
