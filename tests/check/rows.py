"""Rows: what differs from a sound folder, and the rule and place of everything that is found wrong there.

Apart from its name, what is ``found`` and how it is run, a row names files. A spec and ``dodo.yml`` have the top-level
keys that the row leaves out: a spec those of its ``base``, all of them without a value. All other files are whole.
A place without a file is in that of the place before, at first in the row's first file.
"""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
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


@dataclass(frozen=True)
class Row:
    """One case; ``files`` are by path, ``found`` are rules with their places, behind ``warning`` if they warn."""

    name: str
    files: dict[str, Any]
    found: list[str]
    base: str = "drive"
    encoding: str = "utf-8"
    slow: bool = False


def read(path: Path) -> list[Row]:
    known = {"name", "found", "base", "encoding", "slow"}
    rows = yaml.safe_load(path.read_text())
    return [
        Row(**{k: row[k] for k in known & set(row)}, files={k: row[k] for k in row if k not in known}) for row in rows
    ]


def parameters(path: Path) -> list[Any]:
    return [pytest.param(row, id=row.name, marks=[pytest.mark.slow] if row.slow else []) for row in read(path)]


def write(row: Row, folder: Path) -> None:
    """The row's files, in a copy of the registry."""
    shutil.copytree(REGISTRY, folder, dirs_exist_ok=True)
    if not any(path.endswith(SPEC) for path in row.files):
        (folder / f"{row.base}{SPEC}").write_text(_base(row, row.base))
    for path, given in row.files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(given, dict):
            target.symlink_to(given["link"])
        elif isinstance(given, bytes):
            target.write_bytes(given)
        elif path.endswith("/"):
            target.mkdir(parents=True)
        else:
            target.write_bytes(_whole(row, target, given).encode(row.encoding))


def _base(row: Row, name: str) -> str:
    """The spec that a row starts from, under another name."""
    return (BASES / f"{row.base}{SPEC}").read_text().replace(f"name: {row.base}", f"name: {name}")


def _whole(row: Row, target: Path, text: str | None) -> str:
    if target.name.endswith(SPEC) and text != "":
        return merged(_base(row, target.name.removesuffix(SPEC)), text or "")
    return merged((REGISTRY / "dodo.yml").read_text(), text) if target.name == "dodo.yml" and text else text


def found(row: Row, folder: Path, patch: pytest.MonkeyPatch) -> list[str]:
    """What ``dodo compile --check`` finds in the row's files, as rows have it."""
    write(row, folder)
    patch.chdir(folder)
    code, out, err = run("compile", "--check", "--quiet", "--format", "json")
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
