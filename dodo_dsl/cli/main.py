"""``dodo``: parses the command line, calls one command, and turns every error into a sentence and an exit code."""

import argparse
import importlib
import os
import sys
from collections.abc import Collection, Sequence
from types import ModuleType
from typing import NamedTuple, NoReturn, TextIO

from dodo_dsl import __version__
from dodo_dsl.cli.errors import Exit, exit_code, sentence
from dodo_dsl.terminal import harmless_stream


class Subcommand(NamedTuple):
    """A module below ``dodo_dsl.cli``, which is loaded only where its command is called, and what it does."""

    module: str
    summary: str

    def load(self) -> ModuleType:
        return importlib.import_module(f"dodo_dsl.cli.{self.module}")


COMMANDS = {
    "compile": Subcommand("compile", "check tests and write their compose files and child pipeline"),
    "run": Subcommand("run", "run tests and judge the application"),
    "search": Subcommand("search", "look for the conditions under which the application fails a test"),
    "tune": Subcommand("tune", "find values of the application's parameters that increase the test margin"),
    "list": Subcommand("list", "list the tests and services"),
    "explain": Subcommand("explain", "explain a rule, or how a test is wired and what its application must provide"),
    "new": Subcommand("new", "write a new test, a map, an application, or a pipeline"),
    "report": Subcommand("report", "draw reports again, join them into one, and show what changed"),
    "judge": Subcommand("judge", "judge the recording of a test again, also by other limits"),
    "rank": Subcommand("rank", "rank applications by the goals of their tests"),
    "rec": Subcommand("rec", "inspect, cut, export and import recordings"),
    "lsp": Subcommand("lsp", "check tests in an editor whenever one is saved"),
    "images": Subcommand("images", "build and push images"),
    "rig": Subcommand("rig", "operate a rig manually: status, motion, calibration, quarantine and camera"),
    "doctor": Subcommand("doctor", "check what this machine can run, what it lacks and what killed runs left behind"),
}

DEBUG = "DODO_DEBUG"

_EXAMPLES = """examples:
  dodo list                          the tests of the deployment
  dodo compile --check               the problems of all tests; writes nothing
  dodo run sil-closed-straight       run one test and judge the application
  dodo run --level sil -j 2          all simulations, two at a time

levels of tests:
  sil   software in the loop: the world is simulated
  dil   data in the loop: the world is recorded
  hil   hardware in the loop: the world is real
"""


class Arguments(argparse.ArgumentParser):
    """Like argparse's parser, but no error shows the password of a storage."""

    def error(self, message: str) -> NoReturn:
        from dodo_dsl.search.store import masked

        super().error(masked(message))


def parser(called: Collection[str] = tuple(COMMANDS)) -> argparse.ArgumentParser:
    """The command line, with the arguments of the commands that are ``called``."""
    top = Arguments(
        prog="dodo",
        description="Declarative integration tests for robots and vehicles made of microservices.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"dodo {__version__}")
    commands = top.add_subparsers(metavar="COMMAND", dest="command", required=True)
    for name, command in COMMANDS.items():
        words = commands.add_parser(
            name,
            help=command.summary,
            description=command.summary,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if name in called:
            module = command.load()
            words.epilog = module.EXAMPLES
            module.add(words)
            words.set_defaults(main=module.main)
    return top


def main(argv: Sequence[str], stdout: TextIO, stderr: TextIO) -> int:
    """Runs one command. What it cannot do is one sentence here, and an exit code; so is argparse's SystemExit."""
    stdout, stderr = harmless_stream(stdout), harmless_stream(stderr)
    os.environ.pop("DODO_SEARCH_STORAGE", None)  # jobs of a pipeline have it for their command line alone
    if not argv:
        parser(()).print_help(sys.stderr)
        return Exit.USAGE
    try:
        options = parser(argv[:1]).parse_args(argv)
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
        from dodo_dsl.search.store import masked

        code = exit_code(error)
        if code is not None:
            stderr.write(f"dodo {options.command}: {_indented(masked(sentence(error)))}\n")
            return code
        if os.environ.get(DEBUG):
            raise
        said = _indented(f"internal error: {type(error).__name__}: {masked(str(error))}")
        stderr.write(f"dodo {options.command}: {said}\n{DEBUG}=1 shows where\n")
        return Exit.ERROR


def _indented(text: str) -> str:
    """A sentence whose further lines, which others may have written, cannot be taken for DoDo's."""
    return text.replace("\n", "\n  ")
