"""dodo compile: check tests and write their compose files and child pipeline."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli import selection
from dodo_dsl.cli.compile import fixes, job_options, pipeline_file
from dodo_dsl.cli.compile.formats import FORMATS, rendered
from dodo_dsl.cli.display import verbosity
from dodo_dsl.cli.display.colours import write_diagnostics
from dodo_dsl.cli.display.verbosity import Verbosity
from dodo_dsl.cli.errors import NO_APPLICATION, UsageError
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.numbers import patience, positive
from dodo_dsl.compiler import Checked, NoApplication, plan
from dodo_dsl.diagnostics import Diagnostic, forget_lines, has_errors, ordered, shown_path
from dodo_dsl.emit.job_options import JobOptions
from dodo_dsl.emit.output_folder import add_images, differences, stale_folders, write
from dodo_dsl.emit.pipeline import SearchJobs
from dodo_dsl.plan.model import Suite
from dodo_dsl.terminal import printable

EXAMPLES = """examples:
  dodo compile                             all tests of the deployment, into generated/
  dodo compile tests/my-test -o out        one folder of tests
  dodo compile --check                     problems of all tests; writes nothing
  dodo compile --check --fix               writes what has exactly one fix, and shows it as a diff
  dodo compile --check --format gitlab     the same as a code quality report; sarif and junit are others
  dodo compile --forecast 4 --times dodo-report    how long the pipeline takes with four runners
  dodo compile --search sil-my-drive --workers 4   the pipeline also searches this test, in four jobs
  dodo compile --jobs 4 --times dodo-report        four jobs that take about as long, for many short tests
  dodo compile --tags '' --image dodo-runner       its jobs run on any runner, in this image
  dodo compile --files repository          its jobs take recordings from their checkout, and not from an artifact
"""


_OVERHEAD_S = 10.0  # from when GitLab gives a job to a runner until its test begins, and at its end
_WORKERS = 4
_SHORT_DIFF = 30  # lines that are shown without --diff
_MOST_NAMES = 8
_MOST_PASSES = 5
_MOST_PROBLEMS = 1000


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "path",
        nargs="*",
        metavar="PATH",
        help="specs, folders or names of tests; DIR then holds only these (default: all)",
    )
    parser.add_argument("-o", "--output", metavar="DIR", type=Path, default=Path("generated"),
                        help="output folder (default: generated)")  # fmt: skip
    parser.add_argument("--check", action="store_true", help="write nothing; show problems and what is stale in DIR")
    parser.add_argument("--diff", action="store_true", help="with --check: show every difference")
    verbosity.add(parser, "print only problems, and what is stale", "print the name of each test, too")
    parser.add_argument("--fix", action="store_true",
                        help="with --check: correct names, units and spaces where there is one way to")  # fmt: skip
    parser.add_argument("--format", choices=FORMATS, default="text",
                        help="format of the diagnostics (default: text); with gitlab, sarif and junit the text goes to "
                        "standard error")  # fmt: skip
    parser.add_argument("--forecast", type=positive, metavar="R", help="say how long the pipeline takes with R runners")
    parser.add_argument("--times", type=Path, action="append", default=[], metavar="REPORT",
                        help="results or report with times; repeatable (default: the history here)")  # fmt: skip
    parser.add_argument("--overhead", type=patience, default=_OVERHEAD_S, metavar="S",
                        help="seconds that a runner needs to begin a job (default: %(default)g)")  # fmt: skip
    parser.add_argument("--search", action="append", default=[], metavar="TEST",
                        help="add jobs that together search TEST; repeatable")  # fmt: skip
    parser.add_argument("--workers", type=positive, metavar="N",
                        help=f"with --search: jobs of each search (default: {_WORKERS})")  # fmt: skip
    job_options.add(parser)
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    if options.forecast and options.check:
        raise UsageError("--forecast needs the pipeline, which --check does not write: call dodo compile without it")
    if options.fix and not options.check:
        raise UsageError("--fix applies to --check")
    if options.images and options.check:
        raise UsageError("--images are for what is written: call dodo compile without --check")
    if options.workers and not options.search:
        raise UsageError("--workers are jobs of a search: name its test with --search")
    checked = selection.select(options.path, (), options.application)
    if options.fix:
        checked = _fixed(checked, options, stdout if options.format == "text" else stderr)
    if options.verbosity is not Verbosity.QUIET:
        (stdout if options.format == "text" else stderr).write(selection.left_out(checked))
    if options.check:
        return _check(checked, options, stdout, stderr)
    return _write(checked, options, stdout, stderr)


def _fixed(checked: Checked, options: argparse.Namespace, out: TextIO) -> Checked:
    """The tests as they are with all fixes, one of which may bring the next to light."""
    for _ in range(_MOST_PASSES):
        diff = fixes.apply(checked.diagnostics, checked.deployment.root)
        if not diff:
            break
        out.write(diff)
        forget_lines()
        checked = selection.select(options.path, (), options.application)
    return checked


def _log(style: str, stdout: TextIO, stderr: TextIO) -> TextIO | None:
    """Where people read what is wrong: a report is for a file, and the log of its job tells the same as text.

    None for JSON, which a program reads, and where the report itself is on the terminal.
    """
    if style == "text":
        return stdout
    return None if style == "json" or stdout.isatty() else stderr


def _show(diagnostics: list[Diagnostic], style: str, checked: Checked, stdout: TextIO, stderr: TextIO) -> None:
    if style != "text":
        stdout.write(rendered(style, diagnostics, [str(spec.path) for spec in checked.specs]))
    log = _log(style, stdout, stderr)
    if diagnostics and log:
        write_diagnostics(log, diagnostics[:_MOST_PROBLEMS])
        if len(diagnostics) > _MOST_PROBLEMS:
            log.write(f"... {len(diagnostics) - _MOST_PROBLEMS} more problems\n")
        rules = {diagnostic.rule for diagnostic in diagnostics}
        log.write(f"dodo explain {rules.pop() if len(rules) == 1 else 'RULE'} says more\n")


def _check(checked: Checked, options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    diagnostics, stale = ordered([*checked.diagnostics, *pipeline_file.problems(checked.deployment.root)]), {}
    if checked.ok and checked.application is not None and checked.specs:
        made = plan(checked, options.output, _searches(options), job_options.job_options(options))
        diagnostics = ordered([*diagnostics, *made.problems])
        if options.output.is_dir() and not has_errors(diagnostics):
            stale = differences(made.compiled, made.pipeline, options.output)
    _show(diagnostics, options.format, checked, stdout, stderr)
    if has_errors(diagnostics):
        return Exit.USAGE
    outdated = f"{options.output} is stale; dodo compile brings it up to date"
    if log := _log(options.format, stdout, stderr):
        log.write(_difference(stale, options.output, options.diff))
        warnings = [_count(len(diagnostics), "warning")] if diagnostics else []
        state = ", ".join([*warnings, *([outdated] if stale else [])])
        _list(options, log, "checked", [(spec.title, shown_path(str(spec.path))) for spec in checked.specs])
        if options.verbosity is not Verbosity.QUIET or stale:
            log.write(f"{_count(len(checked.specs))} checked: {state or 'no problems'}\n")
    elif stale:
        stderr.write(f"{outdated}\n")
    return Exit.PROBLEMS if stale else Exit.OK


def _list(options: argparse.Namespace, stdout: TextIO, done: str, tests: Sequence[tuple[str, str]]) -> None:
    """What was done with each test, by name and path, if that is wanted."""
    if options.verbosity is Verbosity.VERBOSE:
        width = max((len(name) for name, _ in tests), default=0)
        stdout.writelines(f"{done} {printable(f'{name:<{width}}  {path}')}\n" for name, path in tests)


def _difference(stale: Mapping[str, str], out: Path, in_full: bool) -> str:
    """The diff if it is wanted or short, otherwise the names of what differs."""
    text = "".join(stale.values())
    if in_full or text.count("\n") <= _SHORT_DIFF:
        return text
    return f"stale in {out}: {_names(list(stale))}; --diff shows how\n"


def _names(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


def _write(checked: Checked, options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    jobs = job_options.job_options(options)
    if not checked.ok:
        _show(list(checked.diagnostics), options.format, checked, stdout, stderr)
        return Exit.USAGE
    try:
        made = plan(checked, options.output, _searches(options), jobs)
    except NoApplication:
        raise UsageError(NO_APPLICATION) from None
    diagnostics = ordered([*checked.diagnostics, *made.problems])
    _show(diagnostics, options.format, checked, stdout, stderr)
    if has_errors(diagnostics):
        return Exit.USAGE
    expected = _forecast(made.compiled.suite, jobs, options)
    gone = [folder.name for folder in stale_folders(made.compiled, options.output)]
    write(made.compiled, made.pipeline, options.output)
    if options.images:
        add_images(made.compiled, jobs.images, options.output)
    if options.format == "text" and options.verbosity is not Verbosity.QUIET:
        plans = made.compiled.suite.plans
        _list(options, stdout, "compiled", [(plan.name, str(options.output / plan.slug)) for plan in plans])
        stdout.write(f"{_count(len(plans))} compiled into {options.output}\n")
        if gone:
            stdout.write(f"removed {_count(len(gone), 'stale test')}: {_names(gone)}\n")
    (stdout if options.format == "text" else stderr).write(expected)
    return Exit.OK


def _searches(options: argparse.Namespace) -> tuple[SearchJobs, ...]:
    if not options.search:
        return ()
    from dodo_dsl.cli.compile.searches import search_jobs

    return search_jobs(options.search, options.workers or _WORKERS, options.application)


def _forecast(suite: Suite, jobs: JobOptions, options: argparse.Namespace) -> str:
    """How long the pipeline or its longest job takes, if that is wanted; raises UsageError for what has no times."""
    if not (options.forecast or options.jobs) or not suite.plans:
        return ""
    from dodo_dsl.cli.compile.forecast import forecast_text, packing_text

    if options.forecast:
        return forecast_text(suite, options.forecast, jobs, options.overhead)
    return packing_text(suite, jobs)


def _count(number: int, what: str = "test") -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
