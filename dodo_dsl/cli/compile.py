"""dodo compile: check tests and write their compose files and child pipeline."""

import argparse
import json
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl.cli import selection
from dodo_dsl.cli.display import write_diagnostics
from dodo_dsl.cli.errors import Exit, UsageError, files_of_the_user
from dodo_dsl.compiler import Checked, plan
from dodo_dsl.diagnostics import (
    Diagnostic,
    format_gitlab,
    format_json,
    format_text,
    has_errors,
    ordered,
)
from dodo_dsl.opendlv import regular_file
from dodo_dsl.plan.pipeline import DEFAULT_TAGS, JobOptions
from dodo_dsl.plan.test_files import FilesError

FORMATS: dict[str, Callable[[Sequence[Diagnostic]], str]] = {
    "text": format_text,
    "json": format_json,
    "gitlab": format_gitlab,
}

EXAMPLES = """examples:
  dodo compile                             all tests of dodo.yml, into generated/
  dodo compile tests/my-test -o out        one folder of tests
  dodo compile --check                     problems of all tests; writes nothing
  dodo compile --check --format gitlab     the same as a code quality report
  dodo compile --tags '' --image dodo-runner       its jobs run on any runner, in this image
"""


_MOST_LINES = 100


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
    parser.add_argument("--format", choices=tuple(FORMATS), default="text",
                        help="format of diagnostics (default: text); with gitlab the text goes to stderr")  # fmt: skip
    parser.add_argument("--tags", type=_tags, default=DEFAULT_TAGS, metavar="TAGS",
                        help="tags of the runners of all jobs but those on rigs, separated by commas, or a JSON list; "
                        "'' for none (default: sil)")  # fmt: skip
    parser.add_argument("--image", default="", metavar="IMAGE",
                        help="image of all jobs but those on rigs (default: the runner's own)")  # fmt: skip
    parser.add_argument("--services", type=_services, default=(), metavar="LIST",
                        help="services of all jobs but those on rigs, as a JSON list of what GitLab takes "
                        "(default: none)")  # fmt: skip
    parser.add_argument("--before-script", default="", metavar="COMMANDS",
                        help="first commands of all jobs but those on rigs (default: none)")  # fmt: skip
    parser.add_argument("--run-options", default="", metavar="OPTIONS",
                        help="dodo run options of every test; the variable DODO_RUN_OPTIONS replaces them")  # fmt: skip
    parser.add_argument("--images", type=Path, metavar="FILE",
                        help="lines DODO_IMAGE_<SERVICE>=IMAGE of the application's images that were built: tests run "
                        "in containers of them")  # fmt: skip
    selection.add_application(parser)


_IMAGE = re.compile(r"DODO_IMAGE_[A-Z0-9_]+=[A-Za-z0-9_.:/@-]+")
_NOTHING = ":"
"""The shell's command that does nothing, which a template has where no commands are given."""


def _job_options(options: argparse.Namespace) -> JobOptions:
    images: tuple[str, ...] = ()
    if options.images:
        with files_of_the_user():
            images = tuple(regular_file.text(options.images).splitlines())
        for number, line in enumerate(images, 1):
            if not _IMAGE.fullmatch(line):
                like = "DODO_IMAGE_STEERING=registry.example.org/steering:1"
                raise UsageError(f"{options.images}:{number}: expected a line such as {like}")
    before = options.before_script.strip()
    return JobOptions(
        options.tags,
        options.image.strip(),
        options.services,
        "" if before == _NOTHING else before,
        options.run_options.strip(),
        images,
    )


def _tags(text: str) -> tuple[str, ...]:
    """``sil,docker``, or the JSON list as which a GitLab variable holds an input of type array."""
    words = _json_list(text) if text.strip().startswith("[") else text.split(",")
    if words is None or not all(isinstance(word, str) for word in words):
        raise argparse.ArgumentTypeError(f"'{text}' is not a list of tags, such as '[\"sil\"]' or 'sil,docker'")
    return tuple(dict.fromkeys(word.strip() for word in words if word.strip()))


def _services(text: str) -> tuple[str | dict[str, Any], ...]:
    found = _json_list(text or "[]")
    if found is None or not all(
        (one and isinstance(one, str)) or (isinstance(one, dict) and "name" in one) for one in found
    ):
        expected = "a JSON list of names, such as '[\"docker:dind\"]', or of mappings with a name"
        raise argparse.ArgumentTypeError(f"'{text.strip()}' is not {expected}")
    return tuple(found)


def _json_list(text: str) -> list[Any] | None:
    try:
        found = json.loads(text)
    except ValueError:
        return None
    return found if isinstance(found, list) else None


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # to start its threads takes a tenth of a check's processor time
    if options.images and options.check:
        raise UsageError("--images are for what is written: call dodo compile without --check")
    checked = selection.select(options.path, (), options.application)
    (stdout if options.format == "text" else stderr).write(selection.left_out(checked))
    if options.check:
        return _check(checked, options, stdout, stderr)
    return _write(checked, options, stdout, stderr)


def _log(style: str, stdout: TextIO, stderr: TextIO) -> TextIO | None:
    """Where people read what is wrong: a report is for a file, and the log of its job shows the same as text.

    None for JSON, which a program reads, and where the report itself is on the terminal.
    """
    if style == "text":
        return stdout
    return None if style == "json" or stdout.isatty() else stderr


def _show(diagnostics: Sequence[Diagnostic], style: str, stdout: TextIO, stderr: TextIO) -> None:
    if style != "text":
        stdout.write(FORMATS[style](diagnostics))
    log = _log(style, stdout, stderr)
    if diagnostics and log:
        write_diagnostics(log, diagnostics)
        rules = {diagnostic.rule for diagnostic in diagnostics}
        log.write(f"dodo explain {rules.pop() if len(rules) == 1 else 'RULE'} says more\n")


def _check(checked: Checked, options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    diagnostics, stale = checked.diagnostics, {}
    sound = checked.sound()
    if sound.specs:
        try:
            made = plan(sound, options.output, _job_options(options))
        except FilesError:
            _show(diagnostics, options.format, stdout, stderr)
            raise
        diagnostics = tuple(ordered([*diagnostics, *made.problems]))
        if options.output.is_dir() and not has_errors(diagnostics):
            from dodo_dsl.emit.output_folder import differences

            stale = differences(made.compiled, made.pipeline, options.output)
    _show(diagnostics, options.format, stdout, stderr)
    if has_errors(diagnostics):
        return Exit.USAGE
    outdated = f"{options.output} is stale; dodo compile brings it up to date"
    if log := _log(options.format, stdout, stderr):
        difference = "".join(stale.values()).splitlines(keepends=True)
        log.write("".join(difference[:_MOST_LINES]))
        log.write(f"... {len(difference) - _MOST_LINES} more lines\n" if len(difference) > _MOST_LINES else "")
        warnings = [_count(len(diagnostics), "warning")] if diagnostics else []
        state = ", ".join([*warnings, *([outdated] if stale else [])])
        log.write(f"{_count(len(checked.specs))} checked: {state or 'no problems'}\n")
    elif stale:
        stderr.write(f"{outdated}\n")
    return Exit.PROBLEMS if stale else Exit.OK


def _write(checked: Checked, options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    from dodo_dsl.emit.output_folder import stale_folders, write

    jobs = _job_options(options)
    if not checked.ok:
        _show(checked.diagnostics, options.format, stdout, stderr)
        return Exit.USAGE
    made = plan(checked, options.output, jobs)
    diagnostics = ordered([*checked.diagnostics, *made.problems])
    _show(diagnostics, options.format, stdout, stderr)
    if has_errors(diagnostics):
        return Exit.USAGE
    gone = [folder.name for folder in stale_folders(made.compiled, options.output)]
    write(made.compiled, made.pipeline, options.output, jobs.images)
    if options.format == "text":
        stdout.write(f"{_count(len(made.compiled.suite.plans))} compiled into {options.output}\n")
        stdout.write(f"removed {_count(len(gone), 'stale test')}: {', '.join(gone)}\n" if gone else "")
    return Exit.OK


def _count(number: int, what: str = "test") -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
