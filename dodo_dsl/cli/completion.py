"""dodo completion: print a script that lets a shell complete commands, options, tests, services and rigs.

A shell asks how a command line may go on as argcomplete's scripts ask: with ``_ARGCOMPLETE``.
"""

import argparse
import os
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TextIO

import argcomplete

from dodo_dsl.cli.errors import Exit
from dodo_dsl.cli.main import parser
from dodo_dsl.spec.deployment import Deployment, find_deployment, load_deployment
from dodo_dsl.spec.registry import SUFFIX, locate
from dodo_dsl.spec.rig import EMULATED_RIGS

EXAMPLES = """examples:
  dodo completion bash >> ~/.bashrc
  dodo completion zsh >> ~/.zshrc
  dodo completion fish > ~/.config/fish/completions/dodo.fish

A new shell then completes 'dodo', with the program of this name on its PATH. In an open shell, for example bash:
eval "$(dodo completion bash)".
"""

SHELLS = ("bash", "zsh", "fish")


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="the shell")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    from argcomplete.shell_integration import shellcode

    if options.shell == "zsh":  # whose own completion may not have been started
        stdout.write("(( $+functions[compdef] )) || { autoload -Uz compinit && compinit; }\n")
    stdout.write(shellcode(["dodo"], shell=options.shell) + "\n")
    return Exit.OK


def tests(prefix: str = "", **_: Any) -> list[str]:
    """Names of tests; of a name with a bracket the parameters of its instances; paths of specs and folders."""
    if "/" in prefix:
        from argcomplete.completers import FilesCompleter

        return list(FilesCompleter(allowednames=[SUFFIX])(prefix))
    if "[" in prefix:
        return list(_instances(prefix))
    return sorted({location.stem for location in locate([], _deployment().registry)[0]})


def tests_and_rules(prefix: str = "", **_: Any) -> list[str]:
    from dodo_dsl.check import catalogue

    return [*tests(prefix), *catalogue.pages()]


def services(**_: Any) -> list[str]:
    from dodo_dsl.compiler import load

    return sorted(load([]).manifests)


def rigs(**_: Any) -> list[str]:
    return sorted({*_deployment().rigs, *EMULATED_RIGS})


def _deployment() -> Deployment:
    return load_deployment(find_deployment(Path.cwd()))[0]


def _instances(prefix: str) -> Iterator[str]:
    """The prefix up to its last parameter, with each value of each parameter that is not there yet."""
    from dodo_dsl.compiler import load

    name = prefix.partition("[")[0]
    paths = [location.path for location in locate([], _deployment().registry)[0] if location.stem == name]
    head = prefix[: max(prefix.rfind("["), prefix.rfind(",")) + 1]
    given = {pair.partition("=")[0] for pair in head.partition("[")[2].split(",")}
    values: dict[str, dict[str, None]] = {}
    for spec in load(paths).specs if paths else ():
        for parameter, value in spec.choice.values:
            values.setdefault(parameter, {})[value.text] = None
    left = [parameter for parameter in values if parameter not in given]
    for parameter in left:
        for text in values[parameter]:
            yield f"{head}{parameter}={text}]"
            if len(left) > 1:
                yield f"{head}{parameter}={text},"


Completer = Callable[..., list[str]]
_BY_METAVAR: dict[str, Completer] = {
    "TEST": tests,
    "SPEC": tests,
    "TEST|RULE": tests_and_rules,
    "RIG": rigs,
}
_BY_NAME: dict[tuple[str, str], Completer] = {
    ("compile", "path"): tests,
    ("list", "services"): services,
    ("images", "name"): services,
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
