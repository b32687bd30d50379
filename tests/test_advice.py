"""All advice in messages, typed: what a message tells users to type exists, and takes the problem away.

``test_what_texts_name_exists`` reads every text of the sources, so that no advice is forgotten.
"""

import argparse
import ast
import functools
import re
import tomllib
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest

from dodo_dsl import advice
from dodo_dsl.cli.main import COMMANDS, parser

ROOT = Path(__file__).parents[1]
SOURCES = sorted(path for folder in ("dodo_dsl", "services") for path in (ROOT / folder).rglob("*.py"))
SCRIPTS = sorted(path for path in (ROOT / "scripts").iterdir() if path.is_file())
_DODO = re.compile(r"(?<![\w/.-])dodo (?P<command>" + "|".join(COMMANDS) + r")(?P<rest>(?: [\w=,.*/'-]+)*)")
_OPTION = re.compile(r"--?[a-z][a-z-]*")
_MAKE = re.compile(r"(?<![\w-])make (?:-C \S+ )?(firmware|[a-z]+)(?=$|['`,;: ])")
_SCRIPT = re.compile(r"(?<![\w/-])scripts/([\w.-]*\w)")


def texts(path: Path) -> Iterator[str]:
    """What a file of Python may print: its strings with X for what is filled in, without its docstrings."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "X" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


@functools.cache
def options_of(command: str, *words: str) -> set[str]:
    """Of a command, or of its action."""
    found, rest = parser([command]), [command, *words]
    while actions := [a for a in found._actions if isinstance(a, argparse._SubParsersAction)]:
        if not rest or rest[0] not in actions[0].choices:
            break
        found = actions[0].choices[rest.pop(0)]
    return {option for action in found._actions for option in action.option_strings}


@pytest.mark.thorough
def test_what_texts_name_exists() -> None:
    """Commands with their options, targets of make, and scripts."""
    targets = (ROOT / "Makefile").read_text()
    for path in (*SOURCES, *SCRIPTS):
        for text in texts(path) if path.suffix == ".py" else [path.read_text()]:
            for match in _DODO.finditer(text):
                action, *words = [*match["rest"].replace("'", "").split(), ""]
                asked = {found[0] for word in (action, *words) if (found := _OPTION.match(word))}
                assert asked <= options_of(match["command"], action), (path, match[0])
            for name in _SCRIPT.findall(text):
                assert (ROOT / "scripts" / name).is_file(), (path, text)
            for name in _MAKE.findall(text) if "checkout" in text else ():
                assert f"\n{name}:" in targets, (path, text)
            assert "pip install" not in text or path.suffix != ".py" or path.name in ("advice.py", "video.py"), path


@pytest.mark.thorough
def test_extras_are_those_of_the_project() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    del extras["dev"]
    owners = metadata.packages_distributions()
    for extra, modules in advice._LOADED.items():
        names = {re.split(r"[\[<>=;]", package)[0] for package in extras.pop(extra)}
        assert {owner for module in modules for owner in owners[module.partition(".")[0]]} & names, extra
        assert advice.missing(extra) == ""
    assert not extras


def test_an_engine_elsewhere_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DOCKER_HOST", raising=False)
    assert advice.DOCKER in advice.engine()
    monkeypatch.setenv("DOCKER_HOST", "tcp://10.0.0.1")
    assert "DOCKER_HOST is tcp://10.0.0.1" in advice.engine()
