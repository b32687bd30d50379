"""From a command line of ``dodo run`` to jobs: compiled tests, also at samples, and the folders of their reports."""

import argparse
import contextlib
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from dodo_dsl import atomic, compiler
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.cli import selection
from dodo_dsl.cli.display import write_diagnostics
from dodo_dsl.cli.errors import UsageError, require_extra
from dodo_dsl.compiler import Checked, narrowed, plan
from dodo_dsl.diagnostics import has_errors, ordered
from dodo_dsl.emit.output_folder import write
from dodo_dsl.emit.render import PLAN_FILE
from dodo_dsl.opendlv import regular_file
from dodo_dsl.plan.model import Plan, named, runs
from dodo_dsl.plan.plan_json import PlanError, from_json
from dodo_dsl.plan.test_files import file_problem
from dodo_dsl.report.results import FILE_NAME
from dodo_dsl.run.backends import Job
from dodo_dsl.search.space import space_of, sweep
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.load import Settings, of_test
from dodo_dsl.spec.model import CLOCKS
from dodo_dsl.spec.rig import SIMULATION_TAG
from dodo_dsl.spec.vary import Values
from dodo_dsl.terminal import printable


def without_rigless(checked: Checked, options: argparse.Namespace) -> tuple[Checked, str]:
    """The same without shipped tests whose rig is missing, unless words ask for tests; a line on them."""
    missing = {test.spec.path for test in checked.tests if test.rig and test.rig.is_missing} & checked.unasked
    if not missing or options.test or checked.settings.emulate:
        return checked, ""
    names = printable(", ".join(sorted({spec.location.stem for spec in checked.specs if spec.path in missing})))
    known, fewer = set(checked.diagnostics), narrowed(checked, [s for s in checked.specs if s.path not in missing])
    found = tuple(d for d in fewer.diagnostics if d.severity == "error" or d in known)
    where = f"that need a rig, which dodo.yml does not have: {names} (--emulate takes an emulated one)"
    return replace(fewer, diagnostics=found), f"skipped shipped tests {where}\n"


def prepare(options: argparse.Namespace, folder: Path, stdout: TextIO) -> tuple[list[Job], Deployment]:
    """The jobs of the command line, compiled into ``folder`` unless they are compiled already."""
    emulate, wall = options.emulate, options.wall_timeout
    settings = Settings(CLOCKS.get(options.clock), options.isolation, options.seed, wall, options.repeat, emulate)
    tests: dict[str, str] = {}
    if options.compiled:
        if options.test or options.level or options.application or options.samples:
            raise UsageError(
                "--compiled runs a test as it was compiled: TEST, --level, --samples and --application do not apply"
            )
        plans = [load_compiled(folder, settings) for folder in options.compiled]
        deployment = selection.checked_deployment()
        folders = {plan.slug: path.resolve() for plan, path in zip(plans, options.compiled, strict=True)}
        if len(folders) < len(plans):
            raise UsageError("--compiled names two tests of one name, or one of them twice")
    else:
        plans, deployment, tests = compile_tests(options, settings, folder, stdout, options.samples)
        folders = {plan.slug: folder / plan.slug for plan in plans}
    if emulate:
        plans = [replace(plan, tag=SIMULATION_TAG) for plan in plans]
    report = _usable(options.report, [named(p).slug for p in plans])
    families = {plan.slug: tests.get(plan.slug, named(plan).slug) for plan in plans}
    found: dict[str, Job] = {}
    for repetition, test in runs(plans, settings.repeat):
        plan = named(repetition)
        job = Job(plan, folders[test], report / plan.slug, families[test], work=folder)
        first = found.get(plan.slug)
        found[plan.slug] = replace(first, others=(*first.others, job)) if first else job
    part, parts = options.shard
    mine = set(list(dict.fromkeys(job.test for job in found.values()))[part - 1 :: parts])
    return [job for job in found.values() if job.test in mine], deployment


def load_compiled(folder: Path, settings: Settings) -> Plan:
    """The Plan of a compiled test, whose clock and isolation are settled, and whose files are those that it needs."""
    try:
        plan = from_json(regular_file.text(folder / PLAN_FILE), settings)
    except OSError as error:
        raise UsageError(f"there is no compiled test at '{folder}': {error.strerror}") from error
    except (PlanError, UnicodeDecodeError) as error:
        raise UsageError(f"{folder / PLAN_FILE}: {error}") from error
    if problem := file_problem(folder.resolve(), plan.shared):
        raise UsageError(f"{plan.name}: {problem}")
    if settings.clock not in (None, plan.clock):
        raise UsageError(f"this test is compiled for clock {plan.clock}; compile it again for another")
    if settings.emulate and plan.is_real:
        raise UsageError(f"{plan.name} is compiled for the hardware of rig '{plan.rig}', not for --emulate")
    if settings.isolation == "network" and plan.is_real:
        raise UsageError(f"rig '{plan.rig}' is reached through the host, not with --isolation network")
    return plan


def _usable(report: Path, slugs: Sequence[str]) -> Path:
    """The report's folder, made, and then left out of git; a folder with files of others and no report is refused."""
    try:
        if not report.exists():
            with contextlib.suppress(FileExistsError), atomic.new_folder(report) as stage:  # two runs may begin at once
                (stage / ".gitignore").write_text("*\n")
        is_ours = not any(report.iterdir()) or any(
            map(_is_written_by_dodo, (report / ".gitignore", report / FILE_NAME))
        )
    except OSError as error:
        raise UsageError(f"'{report}' cannot take the report: {error.strerror}") from error
    if not is_ours or any((report / slug / PLAN_FILE).exists() for slug in slugs):
        raise UsageError(f"'{report}' holds other files and no report; name a new or empty folder with --report")
    if not os.access(report, os.W_OK):
        raise UsageError(f"'{report}' cannot take the report: no write permission")
    return report.resolve()


def _is_written_by_dodo(file: Path) -> bool:
    try:
        return regular_file.text(file).startswith(("*\n", '{\n  "dodo": "results"'))
    except (OSError, ValueError):
        return False


def compile_tests(
    options: argparse.Namespace, settings: Settings, folder: Path, stdout: TextIO, samples: int | None = None
) -> tuple[list[Plan], Deployment, dict[str, str]]:
    """The Plans of the tests that ``options`` select, compiled into ``folder``; raises UsageError.

    With ``samples`` those of tests with ranges at so many of their values, and the slug of each one's test by its own.
    """
    checked = selection.select(options.test, options.level, options.application, settings)
    stdout.write(selection.left_out(checked))
    checked, rigless = without_rigless(checked, options)
    stdout.write(rigless)
    if not checked.specs:
        raise UsageError("no tests to run")
    kept = [s.title for s in checked.specs if s.level == "hil" and settings.clock not in (None, s.clock)]
    stdout.write(f"note: {', '.join(kept)} in real time, because hardware does not wait\n" if kept else "")
    if not checked.ok:
        write_diagnostics(stdout, checked.diagnostics)
        raise UsageError("the tests above cannot be compiled")
    tests: dict[str, str] = {}
    if samples:
        checked, tests = sample(checked, samples)
    made = plan(checked, folder)
    problems = ordered([*checked.diagnostics, *made.problems])
    write_diagnostics(stdout, problems)
    if has_errors(problems):
        raise UsageError("the tests above cannot be compiled")
    write(made.compiled, made.pipeline, folder)
    return list(made.compiled.suite.plans), checked.deployment, tests


def sample(checked: compiler.Checked, number: int) -> tuple[compiler.Checked, dict[str, str]]:
    """The tests with ranges at the first values of a sweep, which depend on their seed alone.

    With them the slug of each one's test by its own slug. Raises UsageError if no test has a range.
    """
    require_extra("--samples", "search")
    if not any(test.spec.ranges for test in checked.tests):
        raise UsageError("--samples is for tests with ranges: none of these has 'vary'")
    origins: dict[str, str] = {}

    def swept(test: ResolvedTest) -> list[Values]:
        values = list(sweep(space_of(test), number, test.spec.seed))
        slugs = (f"{test.spec.slug}--{compiler.SAMPLE}-{n}" for n in range(1, len(values) + 1))
        origins.update(dict.fromkeys(slugs, of_test(test.spec).slug))
        return values

    return compiler.sampled(checked, swept), origins
