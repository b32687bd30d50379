"""From a command line of ``dodo run`` to jobs: tests compiled or as they are, and where their reports go."""

import argparse
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli import selection
from dodo_dsl.compiler import NoApplication, plan, with_clock, with_isolation
from dodo_dsl.diagnostics import format_text, has_errors, ordered
from dodo_dsl.emit.output_folder import PLAN_FILE, write
from dodo_dsl.plan.model import Plan, PlanError, from_json
from dodo_dsl.run.backends import Job
from dodo_dsl.run.rigs import rigs
from dodo_dsl.spec.deployment import Deployment


class Usage(Exception):
    """A sentence for the user; the exit code is 2."""


def prepare(options: argparse.Namespace, folder: Path, stdout: TextIO) -> tuple[list[Job], Deployment]:
    """The jobs of the command line, compiled into ``folder`` unless they are compiled already."""
    if options.compiled:
        if options.test or options.level or options.application:
            raise Usage("--compiled runs a test as it was compiled: no TEST, --level or --application beside it")
        plans, deployment = [_load_plan(options.compiled)], Deployment(Path.cwd())
        folders = [options.compiled.resolve()]
        if options.clock not in (None, plans[0].clock):
            raise Usage(f"this test is compiled for clock {plans[0].clock}; compile it again for another")
        if options.isolation == "network" and rigs.is_real(plans[0]):
            raise Usage(f"rig '{plans[0].rig}' is reached through the host, not with --isolation network")
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
        raise Usage(f"'{report}' cannot take the report: {error.strerror}") from error
    for slug in slugs:
        if (report / slug / PLAN_FILE).exists() or any((report / slug).glob("*.dodo.yml")):
            raise Usage(f"'{report}' holds tests; name another folder with --report")
    if not os.access(report, os.W_OK):
        raise Usage(f"'{report}' cannot take the report: it may not be written")
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
        raise Usage(f"there is no compiled test at '{folder}': {error.strerror}") from error
    except (PlanError, UnicodeDecodeError) as error:
        raise Usage(f"{folder / PLAN_FILE}: {error}") from error


def _kept_clock(names: Sequence[str]) -> str:
    """A note about tests on hardware, which run by no other clock than their own."""
    if not names:
        return ""
    who = f"{names[0]} runs" if len(names) == 1 else f"{names[0]} and {len(names) - 1} more run"
    return f"note: {who} in real time, as hardware does not wait\n"


def _compile(options: argparse.Namespace, folder: Path, stdout: TextIO) -> tuple[list[Plan], Deployment]:
    checked = selection.select(options.test, options.level, options.application)
    stdout.write(selection.left_out(checked))
    if not checked.specs:
        raise Usage("there is no test to run")
    if options.clock:
        checked = with_clock(checked, options.clock)
        stdout.write(_kept_clock([s.title for s in checked.specs if s.clock != options.clock]))
    if options.isolation:
        checked = with_isolation(checked, options.isolation)
    problems = checked.diagnostics
    if checked.ok:
        try:
            compiled, more = plan(checked, folder)
        except NoApplication:
            raise Usage("no application; name its compose file with --application or in dodo.yml") from None
        problems = tuple(ordered([*problems, *more]))
    stdout.write(format_text(problems))
    if has_errors(problems):
        raise Usage("the tests above cannot be compiled")
    write(compiled, folder)
    return list(compiled.suite.plans), checked.deployment
