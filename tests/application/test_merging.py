"""Files of an application as one: merged, extended, included and filled in, by DoDo and by compose alike."""

import json
import os
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.application.compiled import FILE, compiled, filled, repository, uniform, written
from tests.emit.readers import compose


class _Loader(yaml.SafeLoader):
    """Keeps the tags of compose."""


@dataclass(frozen=True)
class Tagged:
    """A value with a tag of compose."""

    tag: str
    value: Any


_Loader.add_multi_constructor("!re", lambda loader, suffix, node: Tagged(f"!re{suffix}", _plain(loader, node)))
_Loader.add_multi_constructor("!over", lambda loader, suffix, node: Tagged(f"!over{suffix}", _plain(loader, node)))


def _plain(loader: Any, node: Any) -> Any:
    return loader.construct_sequence(node) if isinstance(node, yaml.SequenceNode) else None


TABLE: dict[str, list[Any]] = yaml.load((Path(__file__).parent / "merging.yml").read_text(), _Loader)
OTHER = {
    "base": {"image": "y", "build": ".", "extends": {"service": "eyes"}},
    "eyes": {"image": "e", "environment": {"A": 1}},
    "built": {"build": {"dockerfile": "D", "additional_contexts": ["d=data"]}},
    "mounts": {"image": "x", "volumes": ["./data:/d:ro"], "env_file": ["o.env"]},
}
FILES = {
    "sub/other.yml": written({"services": OTHER}),
    "sub/more.yml": written({"services": {"base": {"image": "z"}, "eyes": {"environment": {"A": 2}}}}),
    "same.yml": written({"services": {"a": {"image": "y"}}}),
    "../outside.yml": "services: {}\n",
    **dict.fromkeys(("a.env", "b.env", "sub/o.env", "data/x", "data/o.env", "data/data/x", "sub/data/x"), ""),
}


@dataclass(frozen=True)
class Case:
    """Compose files, in their order, with an ``.env``: what services have, or the rule of the error, or its line."""

    texts: tuple[str, ...]
    has: Mapping[str, Mapping[str, Any]] | str | int
    env: str = ""
    by_compose: bool = True
    more: Mapping[str, str] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        return [FILE, *(f"over-{number}.yml" for number in range(1, len(self.texts)))]

    def write(self, folder: Path) -> Path:
        return repository(folder, {**FILES, **dict(zip(self.names, self.texts, strict=True)), ".env": self.env})


def tagged(service: Mapping[str, Any]) -> str:
    lines = (f"    {key}: {_word(value)}" for key, value in service.items())
    return "services:\n  a:\n" + "\n".join(lines) + "\n"


def _word(value: Any) -> str:
    return f"{value.tag} {json.dumps(value.value)}" if isinstance(value, Tagged) else json.dumps(value)


def _services(row: list[Any]) -> Case:
    base, over, has = row
    needs = {"image": "x", "command": "--cid=140"}
    others = {name: {"image": "x", "healthcheck": {"test": "x"}} for name in ("b", "c")}
    whole = {"services": {"a": {**needs, **base}, **others}, "volumes": {"nn": {}, "mm": {}}}
    return Case((written(whole), tagged(over)), {"a": has})


def _extends(row: list[Any]) -> Case:
    extends, has = row
    services = {"a": {"extends": extends, "environment": ["B=2"]}, "b": {"image": "x", "build": "."}}
    return Case((written({"services": services}),), has if isinstance(has, str) else {"a": has})


def _include(row: list[Any]) -> Case:
    include, has = row
    is_sound = has != "application-isolation"  # compose reads files from anywhere
    return Case((written({"include": include, "services": {"a": {"image": "x"}}}),), has, by_compose=is_sound)


def _texts(row: list[Any]) -> Case:
    text, has = row
    document = written({"services": {"a": {"image": "x", "environment": {"T": text}}}})
    return Case(
        (document,),
        has if has.startswith("application-") else {"a": {"environment": {"T": has}}},
        "A=a\nEMPTY=\nS=set\n",
    )


def _commands(row: list[Any]) -> Case:
    command, has = row
    document = written({"services": {"a": {"image": "x", "command": command}}})
    return Case((document,), has if isinstance(has, str) else {"a": {"command": has}}, "A=a\nC=c\n")


def _dotenv(row: list[Any]) -> Case:
    env, has = row
    names = list(has) if isinstance(has, dict) else ["A"]
    document = written({"services": {"a": {"image": "x", "environment": {name: f"${{{name}}}" for name in names}}}})
    return Case((document,), {"a": {"environment": has}} if isinstance(has, dict) else has, env)


CASES: dict[str, Callable[[list[Any]], Case]] = {
    "services": _services,
    "extends": _extends,
    "include": _include,
    "texts": _texts,
    "commands": _commands,
    "dotenv": _dotenv,
}


def cases(few: int = 1) -> list[Any]:
    """All, of which one of ``few`` is no proof."""
    found = [(f"{kind} {row[:-1]}", CASES[kind](row)) for kind, rows in TABLE.items() for row in rows]
    return [
        pytest.param(case, id=name, marks=[pytest.mark.proof] if number % few else [])
        for number, (name, case) in enumerate(found)
    ]


def differ(found: Mapping[str, Any], has: Mapping[str, Any]) -> dict[str, Any]:
    """What services have and should not have, or the other way round; a test has more of its own."""
    wrong = {}
    for name, wanted in has.items():
        for key, value in wanted.items():
            own = found[name].get(key)
            if key == "env_file" and own is None:  # compose shows their variables
                continue
            if key in ("environment", "depends_on", "ulimits") and isinstance(own, dict):
                own = {part: own.get(part) for part in value}
            if own != value:
                wrong[f"{name}.{key}"] = own
    return wrong


@pytest.mark.parametrize("case", cases())
def test_dodo(case: Case, tmp_path: Path) -> None:
    test = compiled(case.write(tmp_path), application=case.names)
    if isinstance(case.has, Mapping):
        assert test.errors == []
        assert differ(test.services, case.has) == {}
    elif isinstance(case.has, str):
        assert case.has in {told.rule for told in test.errors}
        assert all(told.line for told in test.errors)
    else:
        assert case.has in {told.line for told in test.errors if told.file == ".env"}


@pytest.mark.slow
@pytest.mark.parametrize("case", cases(few=6))
def test_compose(case: Case, tmp_path: Path) -> None:
    command = compose()
    root = case.write(tmp_path)
    words = [word for name in case.names for word in ("-f", name)]
    environment = {name: value for name, value in os.environ.items() if name in ("PATH", "HOME")}
    shown = subprocess.run(
        [*command, *words, "config", "--format", "json"], cwd=root, env=environment, capture_output=True, check=False
    )
    (root / "dodo.yml").touch()
    if isinstance(case.has, Mapping):
        assert shown.returncode == 0, shown.stderr
        made = {
            name: uniform(service, root) for name, service in filled(json.loads(shown.stdout)["services"], {}).items()
        }
        assert differ(made, case.has) == {}
    elif case.by_compose:
        assert shown.returncode
