"""All advice in messages, typed: what a message tells users to type exists, and takes the problem away.

``test_what_texts_name_exists`` reads every text of the sources, so that no advice is forgotten. Advice that depends on
the machine is typed in the situation in which it is shown.
"""

import argparse
import ast
import functools
import os
import re
import shlex
import sys
import sysconfig
import tomllib
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path

import pytest

from dodo_dsl import advice, package_data
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
    assert {name: [re.split(r"[<>;]", one)[0] for one in extras[name]] for name in extras} == {
        name: list(packages) for name, packages in advice.PACKAGES.items()
    }
    owners = metadata.packages_distributions()
    for extra, packages in advice.PACKAGES.items():
        names = {re.split(r"[\[=]", package)[0] for package in packages}
        of_modules = {owner for module in advice._LOADED[extra] for owner in owners[module.partition(".")[0]]}
        assert of_modules & names, extra
        assert advice.missing(extra) == ""


@pytest.mark.parametrize(
    ("programs", "expected"),
    [
        (("pip",), "{python} -m pip install scipy"),
        (("uv",), "uv pip install --python {python} scipy"),
        ((), "{python} -m ensurepip && {python} -m pip install scipy"),
    ],
)
def test_an_installed_wheel_names_the_package(
    programs: tuple[str, ...], expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As there is no checkout to name; where the Python has no pip, in the way that it can have packages."""
    for name in programs:
        (tmp_path / name).touch(0o755)
    real = advice.importlib.util.find_spec
    has_pip = "pip" in programs
    monkeypatch.setattr(advice.importlib.util, "find_spec", lambda n: None if n == "pip" and not has_pip else real(n))
    monkeypatch.setattr(package_data, "checkout", lambda: None)
    monkeypatch.setattr(advice, "_DISTRIBUTION", "no-such-distribution")
    monkeypatch.setenv("PATH", str(tmp_path))
    command = advice.install("search")
    assert command == expected.format(python=shlex.quote(sys.executable))
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: path != sysconfig.get_path("purelib") and may(path, mode))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert advice.install("search").split(" && ") == [f"sudo {one}" for one in command.split(" && ")]


APT = {"docker-ce": "(none)", "docker.io": "5:28.1-1", "docker-buildx": "0.13.1", "docker-compose": "1.29.2-3"}


@pytest.mark.parametrize(
    ("asked", "root", "expected"),
    [
        (advice.docker, True, "apt install docker.io"),
        (advice.docker, False, "sudo apt install docker.io"),
        (lambda: advice.docker_plugin("buildx"), False, "sudo apt install docker-buildx"),
        (lambda: advice.docker_plugin("compose"), True, f"{ROOT}/scripts/install-compose"),
        (lambda: advice.docker_plugin("compose"), False, "install docker-compose-plugin from Docker's own repository"),
    ],
)
def test_packages_that_this_machine_can_have(
    asked: Callable[[], str], root: bool, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Compose 1 would not help."""
    cases = "".join(f"{name}) echo '  Candidate: {version}';; " for name, version in APT.items())
    (tmp_path / "apt-cache").write_text(f'#!/bin/sh\ncase "$2" in {cases} esac\n')
    (tmp_path / "apt-get").touch()
    for name in ("apt-cache", "apt-get"):
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(os, "geteuid", lambda: 0 if root else 1000)
    assert asked().startswith(expected)
    if "scripts/" in expected:
        assert os.access(expected, os.X_OK)


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
