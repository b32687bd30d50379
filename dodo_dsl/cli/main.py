"""``dodo``: parses the command line, calls one command, and turns every error into a sentence and an exit code."""

import argparse
import os
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import TextIO

from dodo_dsl import __version__
from dodo_dsl.cli import compile as compile_command
from dodo_dsl.cli import doctor as doctor_command
from dodo_dsl.cli import explain as explain_command
from dodo_dsl.cli import images as images_command
from dodo_dsl.cli import list as list_command
from dodo_dsl.cli import report as report_command
from dodo_dsl.cli.errors import exit_code, sentence
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.judge import command as judge_command
from dodo_dsl.cli.new import command as new_command
from dodo_dsl.cli.rec import command as rec_command
from dodo_dsl.cli.rig import command as rig_command
from dodo_dsl.cli.run import command as run_command
from dodo_dsl.terminal import harmless_stream

COMMANDS: dict[str, ModuleType] = {
    "compile": compile_command,
    "run": run_command,
    "list": list_command,
    "explain": explain_command,
    "new": new_command,
    "report": report_command,
    "judge": judge_command,
    "rec": rec_command,
    "images": images_command,
    "rig": rig_command,
    "doctor": doctor_command,
}

DEBUG = "DODO_DEBUG"

_EXAMPLES = """examples:
  dodo list                          the tests of the deployment
  dodo compile --check               every problem of every test; writes nothing
  dodo run sil-closed-straight       run one test and judge the application
  dodo run --level sil -j 2          all simulations, two at a time
"""


def parser() -> argparse.ArgumentParser:
    """The whole command line."""
    top = argparse.ArgumentParser(
        prog="dodo",
        description="Declarative integration tests for robots and vehicles made of microservices.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"dodo {__version__}")
    commands = top.add_subparsers(metavar="COMMAND", dest="command", required=True)
    for name, module in COMMANDS.items():
        summary = (module.__doc__ or "").splitlines()[0].split(": ", 1)[1].rstrip(".")
        command = commands.add_parser(
            name,
            help=summary,
            description=summary,
            epilog=module.EXAMPLES,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add(command)
        command.set_defaults(main=module.main)
    return top


def main(argv: Sequence[str], stdout: TextIO, stderr: TextIO) -> int:
    """Runs one command. What it cannot do is one sentence here, and an exit code; so is argparse's SystemExit."""
    stdout, stderr = harmless_stream(stdout), harmless_stream(stderr)
    try:
        options = parser().parse_args(argv)
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        return int(options.main(options, stdout, stderr))
    except KeyboardInterrupt:
        return Exit.INTERRUPTED
    except BrokenPipeError:
        # the reader of a pipe left (``dodo list | head``); nothing more can be flushed
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return Exit.OK
    except Exception as error:
        code = exit_code(error)
        if code is not None:
            stderr.write(f"dodo {options.command}: {_indented(sentence(error))}\n")
            return code
        if os.environ.get(DEBUG):
            raise
        said = _indented(f"internal error: {type(error).__name__}: {error}")
        stderr.write(f"dodo {options.command}: {said}\n{DEBUG}=1 shows where\n")
        return Exit.ERROR


def _indented(text: str) -> str:
    """A sentence whose further lines, which others may have written, cannot be taken for DoDo's."""
    return text.replace("\n", "\n  ")
