"""What ``dodo new`` writes for a new test."""

import os
import re
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.new.new_file import New, filled
from dodo_dsl.cli.new.repository_files import schema_of_specs
from dodo_dsl.diagnostics import did_you_mean
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.names import KEYWORDS
from dodo_dsl.spec.registry import SUFFIX

MAPS = ("maps/straight", "maps/rig-straight")
TARGET = "targets/straight-ahead.csv"

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_LONGEST = 60


def check_name(name: str, taken: list[str]) -> None:
    """Raises UsageError for an invalid name, or one that is taken."""
    if not _NAME.fullmatch(name) or len(name) > _LONGEST:
        expected = "lower-case letters and digits in words joined by single hyphens, at most 60 characters"
        raise UsageError(f"'{name}' is not a valid test name, expected {expected}")
    if name in KEYWORDS:
        raise UsageError(f"'{name}' is a keyword of GitLab's pipelines, expected a name for a job")
    if name in taken:
        raise UsageError(f"there is a test '{name}' already; names are unique over all registries")


def test_files(name: str, template: str, registry: Path, root: Path) -> list[New]:
    """A spec that compiles, its README, and the map or target that it needs where the registry has none."""
    folder = registry / name
    spec = filled(template, name=name)
    files = [*spec_files(name, folder, root, spec)]
    for place in MAPS:
        if f"../{place}".encode() in spec and not (registry / place).exists():
            shipped = sorted((package_data.registry() / place).iterdir())
            files += [New(registry / place / path.name, path.read_bytes()) for path in shipped]
    if f"../{TARGET}".encode() in spec and not (registry / TARGET).exists():
        files.append(New(registry / TARGET, filled("tests/straight-ahead.csv")))
    return files


def extending_files(name: str, base: Spec, root: Path) -> list[New]:
    """A spec that extends ``base``, in its registry, and a README."""
    path = base.path.relative_to(base.location.root.resolve()).as_posix()
    text = filled("tests/extends.dodo.yml", name=name, base=path, description=f"As {base.name}, but ...")
    return [*spec_files(name, base.location.root / name, root, text)]


def base_test(name: str, specs: list[Spec]) -> Spec:
    """The test to extend; raises UsageError when there is none."""
    for spec in specs:
        if spec.name == name:
            return spec
    hint = did_you_mean(name, [s.name for s in specs if s.name])
    raise UsageError(f"there is no test '{name}' to extend" + (f"; {hint}" if hint else ""))


def spec_files(name: str, folder: Path, root: Path, text: bytes) -> list[New]:
    """A test's folder: the spec, with the line by which editors know its schema, and a README."""
    description = re.search(r"^description: (.*)$", text.decode(), re.MULTILINE)
    readme = filled("tests/README.md", name=name, description=description[1] if description else "")
    return [New(folder / f"{name}{SUFFIX}", _schema_line(folder, root) + text), New(folder / "README.md", readme)]


def _schema_line(folder: Path, root: Path) -> bytes:
    """The line that tells an editor the schema."""
    schema = Path(os.path.relpath(schema_of_specs(root), folder)).as_posix()
    return f"# yaml-language-server: $schema={schema}\n".encode()
