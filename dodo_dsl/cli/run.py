"""dodo run: run tests and judge the application."""

import argparse
import asyncio
import contextlib
import functools
import os
import resource
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO, cast

from dodo_dsl.cli import progress, selection, summary
from dodo_dsl.cli.exits import Exit
from dodo_dsl.compiler import NoApplication, plan, with_clock, with_isolation
from dodo_dsl.diagnostics import format_text, has_errors, ordered, printable
from dodo_dsl.emit.write import PLAN_FILE, write
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.addresses import subnets
from dodo_dsl.plan.model import Plan, PlanError, from_json
from dodo_dsl.report.write import Drawable, forget, write_report
from dodo_dsl.run import rigs
from dodo_dsl.run.backends import Backends, Containers, Job, Processes
from dodo_dsl.run.history import History
from dodo_dsl.run.runner import Policy, Runner, default_backend
from dodo_dsl.run.schedule import Schedule, schedule
from dodo_dsl.run.workfolder import reap_folders, work_folder
from dodo_dsl.spec.deployment import Deployment

EXAMPLES = """examples:
  dodo run                                     all tests of the deployment
  dodo run sil-closed-straight                 one test
  dodo run 'sil-*' -j 4                        by pattern, four at a time
  dodo run --application ../app/docker-compose.yml --level sil
  dodo run 'sil-*' --repeat 20 --fail-fast     how often they pass, up to the first that does not
  dodo run --compiled generated/sil-closed-straight --report dodo-report

exit codes: 0 all passed, 1 some failed, 2 usage or spec, 3 some ended in error, 130 interrupted
"""


_MOST_SECONDS = 864_000.0


class _Usage(Exception):
    """A sentence for the user; the exit code is 2."""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("test", nargs="*", metavar="TEST", help="names, patterns, specs or folders (default: all)")
    parser.add_argument("--level", action="append", choices=("sil", "dil", "hil"), default=[], help="may be repeated")
    parser.add_argument("--backend", choices=("process", "docker"), help="default: process when the application can")
    parser.add_argument(
        "-j", "--jobs", type=_positive, metavar="N", help="tests at once (default: as many as the cores carry)"
    )
    parser.add_argument("--clock", choices=("realtime", "lockstep"), help="instead of the specs'")
    parser.add_argument("--wall-timeout", type=_seconds, metavar="S", help="most wall time of a test in lockstep")
    parser.add_argument("--isolation", choices=("network", "host"), help="instead of the specs'")
    parser.add_argument("--report", type=Path, default=Path("dodo-report"), metavar="DIR", help="default: dodo-report")
    parser.add_argument("--seed", type=_seed, metavar="N", help="instead of the specs'")
    parser.add_argument("--repeat", type=_positive, default=1, metavar="N", help="run every test N times")
    parser.add_argument("--fail-fast", action="store_true", help="begin no further test when one did not pass")
    parser.add_argument("--retry-errors", type=_positive, nargs="?", const=1, default=0, metavar="N",
                        help="run a test that ended in error again, up to N times (1 when not written)")  # fmt: skip
    parser.add_argument("--compiled", type=Path, metavar="DIR/SLUG", help="a test that dodo compile wrote")
    parser.add_argument("--keep", action="store_true", help="leave everything up and say how to look inside")
    selection.add_application(parser)


def _seed(text: str) -> int:
    number = int(text) if text.isdecimal() and len(text) < 12 else -1
    if not 0 <= number < 1 << 32:
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number from 0 to 4294967295")
    return number


def _seconds(text: str) -> float:
    try:
        seconds = float(text.removesuffix("s"))
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds <= _MOST_SECONDS:
        raise argparse.ArgumentTypeError(f"'{text}' is no time in seconds, above 0 and at most {_MOST_SECONDS:g}")
    return seconds


def _positive(text: str) -> int:
    number = int(text) if text.isdecimal() else 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number of 1 or more")
    return number


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _stop_like_interrupt)
    _more_descriptors()
    stdout = cast(TextIO, _Robust(stdout))
    reap_folders()
    with work_folder() as folder:
        try:
            jobs, deployment = _prepare(options, folder.path, stdout)
            runner = _runner(options, jobs, deployment, stdout, folder.lease.descriptor)
        except (_Usage, selection.NoSuchTest) as error:
            stderr.write(f"dodo run: {error}\n")
            return Exit.USAGE
        outcomes, is_reported = _run(runner, jobs, options.report, stdout)
        if runner.kept:
            stdout.write("\n".join(["", *runner.kept, ""]))
            folder.kept = True
    return max(_exit_code(outcomes, runner.interrupted), Exit.OK if is_reported else Exit.ERROR)


def _more_descriptors() -> None:
    """Every service has a pipe and a log: as many descriptors as this process may have."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _prepare(options: argparse.Namespace, folder: Path, stdout: TextIO) -> tuple[list[Job], Deployment]:
    """The jobs of the command line, compiled into ``folder`` unless they are compiled already."""
    if options.compiled:
        if options.test or options.level or options.application:
            raise _Usage("--compiled runs a test as it was compiled: no TEST, --level or --application beside it")
        plans, deployment = [_load_plan(options.compiled)], Deployment(Path.cwd())
        folders = [options.compiled.resolve()]
        if options.clock not in (None, plans[0].clock):
            raise _Usage(f"this test is compiled for clock {plans[0].clock}; compile it again for another")
        if options.isolation == "network" and rigs.is_real(plans[0]):
            raise _Usage(f"rig '{plans[0].rig}' is reached through the host, not with --isolation network")
    else:
        plans, deployment = _compile(options, folder, stdout)
        folders = [folder / p.slug for p in plans]
    if options.seed is not None:
        plans = [replace(p, seed=options.seed) for p in plans]
    if options.wall_timeout is not None:
        plans = [_with_wall_timeout(p, options.wall_timeout) for p in plans]
    report = _usable(options.report, [p.slug for p in plans])
    return [
        Job(p, f, report / p.slug, original.slug)
        for n in range(options.repeat)
        for original, (p, f) in zip(plans, _repetition(plans, folders, n), strict=True)
    ], deployment


def _with_wall_timeout(plan: Plan, seconds: float) -> Plan:
    return replace(plan, lockstep=replace(plan.lockstep, wall_timeout_s=seconds)) if plan.lockstep else plan


def _usable(report: Path, slugs: Sequence[str]) -> Path:
    """The report's folder, made; a folder of specs or of compiled tests is refused."""
    try:
        report.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _Usage(f"'{report}' cannot take the report: {error.strerror}") from error
    for slug in slugs:
        if (report / slug / PLAN_FILE).exists() or any((report / slug).glob("*.dodo.yml")):
            raise _Usage(f"'{report}' holds tests; name another folder with --report")
    if not os.access(report, os.W_OK):
        raise _Usage(f"'{report}' cannot take the report: it may not be written")
    return report.resolve()


def _repetition(plans: Sequence[Plan], folders: Sequence[Path], number: int) -> list[tuple[Plan, Path]]:
    """The n-th time around: from the second on, name and slug say so."""
    if number == 0:
        return list(zip(plans, folders, strict=True))
    renamed = [replace(p, name=f"{p.name}[run={number + 1}]", slug=f"{p.slug}--run-{number + 1}") for p in plans]
    return list(zip(renamed, folders, strict=True))


def _load_plan(folder: Path) -> Plan:
    try:
        return from_json((folder / PLAN_FILE).read_text(encoding="utf-8"))
    except OSError as error:
        raise _Usage(f"there is no compiled test at '{folder}': {error.strerror}") from error
    except (PlanError, UnicodeDecodeError) as error:
        raise _Usage(f"{folder / PLAN_FILE}: {error}") from error


def _compile(options: argparse.Namespace, folder: Path, stdout: TextIO) -> tuple[list[Plan], Deployment]:
    checked = selection.select(options.test, options.level, options.application)
    if not checked.specs:
        raise _Usage("there is no test to run")
    if options.clock:
        checked = with_clock(checked, options.clock)
    if options.isolation:
        checked = with_isolation(checked, options.isolation)
    problems = checked.diagnostics
    if checked.ok:
        try:
            compiled, more = plan(checked, folder)
        except NoApplication:
            raise _Usage("no application; name its compose file with --application or in dodo.yml") from None
        problems = tuple(ordered([*problems, *more]))
    stdout.write(format_text(problems))
    if has_errors(problems):
        raise _Usage("the tests above cannot be compiled")
    write(compiled, folder)
    return list(compiled.suite.plans), checked.deployment


def _runner(
    options: argparse.Namespace, jobs: Sequence[Job], deployment: Deployment, stdout: TextIO, descriptor: int
) -> Runner:
    plans = [job.plan for job in jobs]
    backend = options.backend or default_backend(plans)
    order = schedule(options.jobs, _expectation(backend))
    stdout.write(f"{progress.count(len(jobs))}, {_at_once(order, jobs)}, {backend} backend; ")
    stdout.write(f"{_forecast(order, jobs, backend)}\n")
    shown = progress.choose(stdout, [p.slug for p in plans])
    backends = _backends(options, backend, plans, deployment, descriptor)
    return Runner(shown, backends, order, Policy(options.fail_fast, options.retry_errors), options.keep)


def _at_once(order: Schedule, jobs: Sequence[Job]) -> str:
    """How many tests run at a time, in words."""
    most = min(int(order.capacity / max(min(order.need(job) for job in jobs), 0.01)), len(jobs))
    return f"{'up to ' * (len(jobs) > 1)}{max(most, 1)} at a time"


def _forecast(order: Schedule, jobs: Sequence[Job], backend: str) -> str:
    """How long the run will take, in words; a test that never ran here may take its whole time."""
    history = History()
    known = all(history.seconds(j.plan.spec, j.test, backend, j.plan.clock) is not None for j in jobs)
    seconds = order.forecast(order.ordered(jobs))
    return progress.about(seconds) if known else progress.about(seconds).replace("about", "at most")


def _expectation(backend: str) -> Callable[[Job], float]:
    """How long a job takes as the history has it; an unknown one may take its whole time."""
    history = History()

    @functools.cache
    def known(spec: str, test: str, clock: str) -> float | None:
        return history.seconds(spec, test, backend, clock)

    def expected(job: Job) -> float:
        seconds = known(job.plan.spec, job.test, job.plan.clock)
        return job.plan.timeout_s if seconds is None else seconds

    return expected


def _backends(
    options: argparse.Namespace, backend: str, plans: Sequence[Plan], deployment: Deployment, descriptor: int
) -> Backends:
    if backend == "docker":
        if options.compiled and options.isolation not in (None, plans[0].isolation):
            raise _Usage(f"this test is compiled for isolation {plans[0].isolation}; compile it again for another")
        return Containers(subnets(deployment.subnets))
    without = sorted({s.name for p in plans for s in p.application.services if not s.process})
    if without:
        raise _Usage(f"application service '{without[0]}' has no 'x-dodo-process', which the process backend needs")
    return Processes(deployment.cids, options.isolation, (descriptor,))


def _run(runner: Runner, jobs: Sequence[Job], report: Path, stdout: TextIO) -> tuple[list[Outcome], bool]:
    """The outcomes, and whether the report holds all of them; without it they are told all the same."""
    forget(report.resolve(), [job.plan.slug for job in jobs])
    with runner.progress:
        outcomes = asyncio.run(runner.run(jobs))
    tests = {job.plan.slug: job.test for job in jobs}
    with _undisturbed():
        history = History()
        history.add((tests[outcome.slug], outcome) for outcome in outcomes)
        times = history.times({(job.plan.spec, job.test) for job in jobs}, runner.backends.name)
        drawables = {job.plan.slug: Drawable(job.plan, job.folder) for job in jobs}
        problems, unwritten = [], ""
        try:
            problems = write_report(report, outcomes, drawables, times)
        except Exception as error:  # noqa: BLE001  (the outcomes are told all the same)
            why = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
            unwritten = f"'{report}' cannot take the whole report: {why}"
        history.save()
    stdout.writelines(f"{printable(problem)}\n" for problem in problems)
    summary.write(stdout, outcomes, tests, [job.plan.name for job in runner.skipped])
    stdout.write(f"{unwritten}\n" if unwritten else f"report: {report / 'index.html'}\n")
    return outcomes, not unwritten


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Results that exist are written, whoever presses Ctrl-C now."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, signal.SIG_IGN) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


class _Robust:
    """A stream whose reader may leave (``dodo run | head``): the run goes on to its end and report."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._broken = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        try:
            return 0 if self._broken else self._stream.write(text)
        except OSError:
            return self._give_up()

    def writelines(self, lines: Iterable[str]) -> None:
        self.write("".join(lines))

    def flush(self) -> None:
        try:
            if not self._broken:
                self._stream.flush()
        except OSError:
            self._give_up()

    def _give_up(self) -> int:
        self._broken = True
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
        return 0


def _stop_like_interrupt(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt


def _exit_code(outcomes: Sequence[Outcome], interrupted: bool) -> Exit:
    if interrupted:
        return Exit.INTERRUPTED
    kinds = {o.outcome for o in outcomes}
    return Exit.ERROR if "error" in kinds else Exit.PROBLEMS if "failed" in kinds else Exit.OK
