"""All advice in messages, typed: what a message tells users to type exists, and takes the problem away.

``test_what_texts_name_exists`` reads every text of the sources, so that no advice is forgotten. Advice that depends on
the machine is typed in the situation in which it is shown.
"""

import argparse
import ast
import functools
import os
import re
import sysconfig
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
            assert not re.search(r"install .*dodo-dsl", text), (path, "it is on no index")
            assert "pip install" not in text or path.suffix != ".py" or path.name == "video.py", path


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


@pytest.mark.parametrize(("checkout", "expected"), [(ROOT, [f"{ROOT}[mcap]"]), (None, ["mcap", "foxglove"])])
def test_pip_gets_the_checkout_with_the_extra_or_else_its_packages(
    checkout: Path | None, expected: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(advice, "_installed_from", lambda: checkout)
    command = advice.install("mcap")
    assert all(word in command for word in expected) and "scipy" not in command
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: path != sysconfig.get_path("purelib") and may(path, mode))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert advice.install("mcap") == f"sudo {command}"


def test_an_engine_that_does_not_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each way out is for one reason: a remote engine, the group of the socket, no engine, one that is not started."""
    socket = tmp_path / "docker.sock"
    monkeypatch.setattr(advice, "_SOCKET", socket)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.delenv("DOCKER_HOST", raising=False)
    assert advice.engine() == advice.docker()
    (tmp_path / "dockerd").touch(0o755)
    assert advice.engine() in {"sudo systemctl start docker", "sudo dockerd"}
    socket.touch(0o660)
    monkeypatch.setattr(os, "access", lambda path, _: path != socket)
    monkeypatch.setattr(Path, "stat", lambda path, **_: os.stat_result((0o140660, 0, 0, 0, 0, 12, 0, 0, 0, 0)))
    assert re.fullmatch(r"sudo usermod --append --groups \w+ \w+, and log in again", advice.join(socket))
    monkeypatch.undo()
    monkeypatch.setenv("DOCKER_HOST", "tcp://10.0.0.1")
    assert "unset DOCKER_HOST" in advice.engine()
