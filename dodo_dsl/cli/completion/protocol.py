"""Answers a shell that asks how a command line may go on, as argcomplete's scripts ask: with ``_ARGCOMPLETE``."""

import argparse
import os
import shlex
from collections.abc import Callable, Iterator

import argcomplete

from dodo_dsl.cli.completion import candidates
from dodo_dsl.cli.main import parser

Completer = Callable[..., list[str]]
_BY_METAVAR: dict[str, Completer] = {
    "TEST": candidates.tests,
    "SPEC": candidates.tests,
    "TEST|RULE": candidates.tests_and_rules,
    "RIG": candidates.rigs,
}
_BY_NAME: dict[tuple[str, str], Completer] = {
    ("compile", "path"): candidates.tests,
    ("list", "services"): candidates.services,
    ("images", "name"): candidates.services,
}
"""By command and name of the argument."""


def answer() -> None:
    """Writes the candidates where the shell reads them, and ends the process."""
    command = _command(os.environ.get("COMP_LINE", ""))
    known = parser((command,))
    for action in _actions(known):
        found = _BY_NAME.get((command, action.dest)) or _BY_METAVAR.get(str(action.metavar))
        if found:
            action.completer = found  # type: ignore[attr-defined]
    argcomplete.autocomplete(known, always_complete_options=False)


def _command(line: str) -> str:
    """The first word after ``dodo``."""
    try:
        words = shlex.split(line)
    except ValueError:  # a quote is open
        words = line.split()
    return words[1] if len(words) > 1 else ""


def _actions(known: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """The arguments of a parser and of its commands."""
    for action in known._actions:
        yield action
        if isinstance(action.choices, dict):
            for below in action.choices.values():
                yield from _actions(below)
