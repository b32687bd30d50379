"""The files that ``dodo new`` writes: filled templates, and tests that are copied."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import yaml

from dodo_dsl import package_data, templates
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.source import Mapping as Written
from dodo_dsl.source import plain, read
from dodo_dsl.spec import load, vary
from dodo_dsl.spec.model import LAYERS, Spec
from dodo_dsl.spec.registry import SUFFIX

SCHEMAS = ("deployment.schema.json", "application.schema.json", "dodo.schema.json")
SCHEMA_FOLDERS = (".dodo", "schemas")
"""Where a repository may have the schemas for editors: the first is where ``dodo new`` writes them."""
_TARGET = "targets/weave.csv"


@dataclass(frozen=True)
class New:
    path: Path
    content: bytes


def filled(template: str, **values: object) -> bytes:
    environment = templates.environment("new", keep_trailing_newline=True, trim_blocks=True)
    return environment.get_template(template).render(**values).encode()


def filled_folder(name: str, root: Path, **values: object) -> dict[str, New]:
    """The files of a folder of templates, each in its place below ``root``, by that place."""
    folder = package_data.templates() / "new" / name
    found = (path.relative_to(folder).as_posix() for path in sorted(folder.rglob("*")) if path.is_file())
    names = [path for path in found if "__pycache__" not in path]  # of an installed DoDo
    return {path: New(root / path, filled(f"{name}/{path}", **values)) for path in names}


def spec_files(name: str, folder: Path, root: Path, text: bytes) -> list[New]:
    """A test, with the line by which editors know its schema where the repository has that."""
    places = (root / place / SCHEMAS[-1] for place in SCHEMA_FOLDERS)
    schema = next((os.path.relpath(place, folder) for place in places if place.is_file()), "")
    line = f"# yaml-language-server: $schema={schema}\n".encode() if schema else b""
    return [New(folder / f"{name}{SUFFIX}", line + text)]


def world_files(text: bytes, registry: Path) -> list[New]:
    """The map and the target of a template's test, where the registry has none."""
    files = []
    if not (registry / "maps/straight").exists():
        files += map_files("straight", registry / "maps/straight")
    if f"../{_TARGET}".encode() in text and not (registry / _TARGET).exists():
        files.append(New(registry / _TARGET, filled("tests/weave.csv")))
    return files


def map_files(name: str, folder: Path) -> list[New]:
    shipped = sorted((package_data.registry() / "maps" / name).iterdir())
    return [New(folder / path.name, path.read_bytes()) for path in shipped]


def extending_files(name: str, base: Spec, root: Path) -> list[New]:
    path = base.path.relative_to(base.location.root.resolve()).as_posix()
    text = filled("tests/extends.dodo.yml", name=name, base=path, of=base.name)
    return spec_files(name, base.location.root / name, root, text)


def copied_files(name: str, base: Spec, registry: Path, root: Path) -> list[New]:
    """A copy of a shipped test as ``name``, with the files that it names and the registry lacks."""
    text = _copied_text(name, base)
    files = spec_files(name, registry / name, root, text)
    shipped, own = base.location.root.resolve(), base.path.resolve().parent
    words = re.findall(r"[\w.][\w./-]*", text.decode())
    for path in dict.fromkeys((own / word).resolve() for word in words if (own / word).exists()):
        is_own = path != own and path.is_relative_to(own)
        if not is_own and (path in own.parents or path == own or (registry / path.relative_to(shipped)).exists()):
            continue
        for source in (path,) if path.is_file() else sorted(each for each in path.rglob("*") if each.is_file()):
            place = Path(name) / source.relative_to(own) if is_own else source.relative_to(shipped)
            files.append(New(registry / place, source.read_bytes()))
    return list({file.path: file for file in files}.values())


def _copied_text(name: str, base: Spec) -> bytes:
    """The spec's own text; one that extends others is resolved first, as the copy leaves them behind."""
    node, _ = read(base.path)
    if not isinstance(node, Written):
        raise UsageError(f"'{base.name}' cannot be read, so it cannot be copied")
    if load.EXTENDS not in node.entries:
        text = re.sub(r"^# yaml-language-server:.*\n", "", base.path.read_text(encoding="utf-8"))
        return re.sub(r"^name: .*$", f"name: {name}", text, count=1, flags=re.MULTILINE).encode()
    resolved = load.resolve(node, base.path, base.location.root)[0]
    written = {"dodo": 1, **plain(resolved), "name": name}
    used = vary.PLACEHOLDERS.used(resolved) if isinstance(resolved, Written) else ()
    written[vary.KEY] = {key: one for key, one in written.get(vary.KEY, {}).items() if key in used}
    first = ("dodo", "name", *(key for key in written if key not in ("dodo", "name", *LAYERS)))
    keys = {key: written[key] for key in (*first, *LAYERS) if written.get(key)}
    return str(yaml.safe_dump(keys, sort_keys=False, default_flow_style=None, width=1000, allow_unicode=True)).encode()


def write_new(files: Sequence[New], stdout: TextIO) -> None:
    for file in files:
        if file.path.exists():
            raise UsageError(f"'{shown_path(str(file.path))}' exists already; nothing was written")
    for file in files:
        file.path.parent.mkdir(parents=True, exist_ok=True)
        with file.path.open("xb") as stream:
            stream.write(file.content)
        stdout.write(f"wrote {shown_path(str(file.path))}\n")


def say_next(steps: Sequence[str], stdout: TextIO) -> None:
    stdout.write("\nnext: " + "\n      ".join(steps) + "\n")
