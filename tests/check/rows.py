"""Rows: what differs from a sound folder, and the rule and place of everything that is found wrong there.

Apart from its name, what is ``found`` and how it is run, a row names files. Those that are there before, a spec as its
``base`` is, get new text for old, as a mapping, or new top-level keys; without a value they stay. A text is the whole
file if it begins with ``dodo: 1``, ``extends`` or no key. All other files are whole, too; ``driver`` are more keys of
the service in ``docker-compose.yml``. A place without a file is in that of the place before, at first in the row's
first file.
"""

import json
import re
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import indent
from typing import Any

import pytest
import yaml

from tests.check.examples import merged
from tests.emit.readers import run

FOLDER = Path(__file__).parent
BASES = FOLDER / "bases"
ROWS = FOLDER / "rows"
REGISTRY = FOLDER / "registry"
SPEC = ".dodo.yml"
COMPOSE = "docker-compose.yml"
MERGED = ("dodo.yml", "service.yml")
_KEY = re.compile(r"(?!dodo: 1|extends:)[a-z]")


@dataclass(frozen=True)
class Row:
    """One case; ``files`` are by path, ``found`` are rules with their places, behind ``warning`` if they warn."""

    name: str
    files: dict[str, Any]
    found: list[str]
    base: str = "drive"
    encoding: str = "utf-8"
    slow: bool = False
    links: dict[str, str] = field(default_factory=dict)
    paths: tuple[str, ...] = ()


def read(path: Path) -> list[Row]:
    return [_row(**row) for row in yaml.safe_load(path.read_text())]


def _row(driver: str = "", **keys: Any) -> Row:
    known = {"name", "found", "base", "encoding", "slow", "links", "paths"} & set(keys)
    files = {COMPOSE: (REGISTRY / COMPOSE).read_text() + indent(driver, "    ")} if driver else {}
    files |= {path: given for path, given in keys.items() if path not in known}
    return Row(**{key: keys[key] for key in known}, files=files)


def write(row: Row, folder: Path) -> None:
    """The row's files, in a copy of the registry."""
    shutil.copytree(REGISTRY, folder, dirs_exist_ok=True)
    if not any(path.endswith(SPEC) for path in row.files):
        (folder / f"{row.base}{SPEC}").write_text(_base(row, row.base))
    for path, given in row.files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(given, bytes):
            target.write_bytes(given)
        elif path.endswith("/"):
            target.mkdir(parents=True)
        else:
            target.write_bytes(_text(row, target, given).encode(row.encoding))
    for path, to in row.links.items():
        (folder / path).symlink_to(to)


def _base(row: Row, name: str) -> str:
    """The spec that a row starts from, under another name."""
    return (BASES / f"{row.base}{SPEC}").read_text().replace(f"name: {row.base}", f"name: {name}")


def _text(row: Row, target: Path, given: str | dict[str, str] | None) -> str:
    """What a file gets; ``target`` is there if it is one of the registry's."""
    name = target.name.removesuffix(SPEC)
    is_spec = name != target.name
    if isinstance(given, str) and not ((is_spec or (name in MERGED and target.is_file())) and _KEY.match(given)):
        return given
    before = _base(row, name) if is_spec else target.read_text()
    if isinstance(given, str):
        return merged(before, given)
    changes = {old: str(new) for old, new in (given or {}).items()}
    assert all(before.count(old) == 1 for old in changes), f"{target.name} has one of {list(changes)} not once"
    return re.sub("|".join(map(re.escape, changes)) or "^", lambda found: changes.get(found[0], ""), before)


def found(row: Row, folder: Path, patch: pytest.MonkeyPatch) -> list[str]:
    """What ``dodo compile --check`` finds in the row's files, as rows have it."""
    write(row, folder)
    patch.chdir(folder)
    code, out, err = run("compile", *row.paths, "--check", "--format", "json")
    assert not err
    places: dict[str, str] = {}
    files: dict[str, str] = {}
    for one in json.loads(out):
        rule = one["rule"] if one["severity"] == "error" else f"warning {one['rule']}"
        file = "" if one["file"] == files.get(rule, next(iter(row.files), f"{row.base}{SPEC}")) else f"{one['file']}:"
        places[rule] = f"{places.get(rule, rule)} {file}{one['line']}:{one['column']}"
        files[rule] = one["file"]
    assert code == (2 if any(not rule.startswith("warning ") for rule in places) else 0)
    return list(places.values())
