"""dodo compile: check tests and write their compose files and child pipeline."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import NO_APPLICATION, UsageError
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.formats import FORMATS, rendered
from dodo_dsl.compiler import Checked, NoApplication, plan
from dodo_dsl.diagnostics import Diagnostic, format_text, has_errors, ordered
from dodo_dsl.emit.output_folder import differences, stale_folders, write

EXAMPLES = """examples:
  dodo compile                             all tests of the deployment, into generated/
  dodo compile tests/my-test -o out        one folder of tests
  dodo compile --check                     problems of all tests; writes nothing
  dodo compile --check --format gitlab     the same as a code quality report; sarif and junit are others
"""


_SHORT_DIFF = 30  # lines that are shown without --diff
_MOST_NAMES = 8
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
    parser.add_argument("--format", choices=FORMATS, default="text", help="format of the diagnostics (default: text)")
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    checked = selection.select(options.path, (), options.application)
    (stdout if options.format == "text" else stderr).write(selection.left_out(checked))
    if options.check:
        return _check(checked, options, stdout, stderr)
    return _write(checked, options, stdout)


def _show(diagnostics: list[Diagnostic], style: str, checked: Checked, stdout: TextIO) -> None:
    if style != "text":
        stdout.write(rendered(style, diagnostics, [str(spec.path) for spec in checked.specs]))
    elif diagnostics:
        stdout.write(format_text(diagnostics[:_MOST_PROBLEMS]))
        if len(diagnostics) > _MOST_PROBLEMS:
            stdout.write(f"... {len(diagnostics) - _MOST_PROBLEMS} more problems\n")
        rules = {diagnostic.rule for diagnostic in diagnostics}
        stdout.write(f"dodo explain {rules.pop() if len(rules) == 1 else 'RULE'} says more\n")


def _check(checked: Checked, options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    diagnostics, stale = list(checked.diagnostics), {}
    if checked.ok and checked.application is not None and checked.specs:
        made = plan(checked, options.output)
        diagnostics = ordered([*diagnostics, *made.problems])
        if options.output.is_dir() and not has_errors(diagnostics):
            stale = differences(made.compiled, made.pipeline, options.output)
    _show(diagnostics, options.format, checked, stdout)
    if has_errors(diagnostics):
        return Exit.USAGE
    outdated = f"{options.output} is stale; dodo compile brings it up to date"
    if options.format == "text":
        stdout.write(_difference(stale, options.output, options.diff))
        warnings = [_count(len(diagnostics), "warning")] if diagnostics else []
        state = ", ".join([*warnings, *([outdated] if stale else [])])
        stdout.write(f"{_count(len(checked.specs))} checked: {state or 'no problems'}\n")
    elif stale:
        stderr.write(f"{outdated}\n")
    return Exit.PROBLEMS if stale else Exit.OK


def _difference(stale: Mapping[str, str], out: Path, in_full: bool) -> str:
    """The diff if it is wanted or short, otherwise the names of what differs."""
    text = "".join(stale.values())
    if in_full or text.count("\n") <= _SHORT_DIFF:
        return text
    return f"stale in {out}: {_names(list(stale))}; --diff shows how\n"


def _names(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


def _write(checked: Checked, options: argparse.Namespace, stdout: TextIO) -> int:
    if not checked.ok:
        _show(list(checked.diagnostics), options.format, checked, stdout)
        return Exit.USAGE
    try:
        made = plan(checked, options.output)
    except NoApplication:
        raise UsageError(NO_APPLICATION) from None
    diagnostics = ordered([*checked.diagnostics, *made.problems])
    _show(diagnostics, options.format, checked, stdout)
    if has_errors(diagnostics):
        return Exit.USAGE
    gone = [folder.name for folder in stale_folders(made.compiled, options.output)]
    write(made.compiled, made.pipeline, options.output)
    if options.format == "text":
        stdout.write(f"{_count(len(made.compiled.suite.plans))} compiled into {options.output}\n")
        if gone:
            stdout.write(f"removed {_count(len(gone), 'stale test')}: {_names(gone)}\n")
    return Exit.OK


def _count(number: int, what: str = "test") -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
