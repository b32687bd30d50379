"""How a command line may go on, where a shell asks with ``_ARGCOMPLETE``: ``register-python-argcomplete dodo``."""

import argparse
import os
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import argcomplete

from dodo_dsl.cli.main import parser
from dodo_dsl.spec.deployment import Deployment, find_deployment, load_deployment
from dodo_dsl.spec.registry import SUFFIX, locate
from dodo_dsl.spec.rig import EMULATED_RIGS


def tests(prefix: str = "", **_: Any) -> list[str]:
    """Names of tests, or paths of specs and folders."""
    if "/" in prefix:
        from argcomplete.completers import FilesCompleter

        return list(FilesCompleter(allowednames=[SUFFIX])(prefix))
    return sorted({location.stem for location in locate([], _deployment().registry)[0]})


def tests_and_rules(prefix: str = "", **_: Any) -> list[str]:
    from dodo_dsl.check import catalogue

    return [*tests(prefix), *catalogue.pages()]


def rigs(**_: Any) -> list[str]:
    return sorted({*_deployment().rigs, *EMULATED_RIGS})


def _deployment() -> Deployment:
    return load_deployment(find_deployment(Path.cwd()))[0]


_COMPLETERS: dict[str, Callable[..., list[str]]] = {
    "TEST": tests,
    "SPEC": tests,
    "PATH": tests,
    "TEST|RULE": tests_and_rules,
    "RIG": rigs,
}
"""By what an argument is called in the help; all others are completed as files."""


def answer() -> None:
    """Writes the candidates where the shell reads them, and ends the process."""
    command = _command(os.environ.get("COMP_LINE", ""))
    known = parser((command,))
    for action in _actions(known):
        if completer := _COMPLETERS.get(str(action.metavar)):
            action.completer = completer  # type: ignore[attr-defined]
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
