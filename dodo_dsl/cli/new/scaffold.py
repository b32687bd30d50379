"""What ``dodo new`` writes: the files of a new test and of a new repository."""

import functools
import os
import re
from dataclasses import dataclass
from pathlib import Path

import jinja2

from dodo_dsl import package_data
from dodo_dsl.check.rules.names import KEYWORDS
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.diagnostics import did_you_mean
from dodo_dsl.spec.deployment.deployment import FILE_NAME
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.registry import SUFFIX

MAPS = ("maps/straight", "maps/rig-straight")
TARGET = "targets/straight-ahead.csv"
COMPOSE_FILES = ("docker-compose.yml", "docker-compose.yaml", "compose.yml", "compose.yaml")
SCHEMAS = ".dodo"

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_LONGEST = 60
_SHIPPED = {
    "dil-open-loop": "dil-kiwi-track",
    "dil-perception": "dil-static-rig",
    "sil-perception": "sil-perception",
    "hil-perception": "hil-camera",
}
"""Shipped tests to copy for kinds that need a recording or true boxes."""


@dataclass(frozen=True)
class New:
    """A file to write: its path and its content."""

    path: Path
    content: bytes


@functools.cache
def _templates() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(package_data.templates() / "new"),
        undefined=jinja2.StrictUndefined,
        autoescape=False,  # noqa: S701  (YAML and Markdown of names that are checked)
        keep_trailing_newline=True,
    )


def _filled(template: str, **values: str) -> bytes:
    return _templates().get_template(template).render(**values).encode()


def check_name(name: str, taken: list[str]) -> None:
    """Raises UsageError for an invalid name, or one that is taken."""
    if not _NAME.fullmatch(name) or len(name) > _LONGEST:
        expected = "lower-case letters and digits in words joined by single hyphens, at most 60 characters"
        raise UsageError(f"'{name}' is not a valid test name, expected {expected}")
    if name in KEYWORDS:
        raise UsageError(f"'{name}' is a keyword of GitLab's pipelines, expected a name for a job")
    if name in taken:
        raise UsageError(f"there is a test '{name}' already; names are unique over all registries")


def test_files(name: str, level: str, kind: str, registry: Path, root: Path) -> list[New]:
    """A spec that compiles, its README, and the map or target that it needs where the registry has none."""
    template = _template(name, level, kind)
    folder = registry / name
    spec = _filled(template, name=name)
    files = [*spec_files(name, folder, root, spec)]
    for place in MAPS:
        if f"../{place}".encode() in spec and not (registry / place).exists():
            shipped = sorted((package_data.registry() / place).iterdir())
            files += [New(registry / place / path.name, path.read_bytes()) for path in shipped]
    if f"../{TARGET}".encode() in spec and not (registry / TARGET).exists():
        files.append(New(registry / TARGET, _filled("tests/straight-ahead.csv")))
    return files


def _template(name: str, level: str, kind: str) -> str:
    template = f"tests/{level}-{kind}{SUFFIX}"
    if (package_data.templates() / "new" / template).is_file():
        return template
    if (level, kind) == ("dil", "closed-loop"):
        reason = "a dil test cannot be closed-loop: what was recorded does not react to the application"
        raise UsageError(f"{reason}; try: dodo new {name} --level dil --kind open-loop")
    shipped = _SHIPPED.get(f"{level}-{kind}")
    if shipped is None:
        reason = f"a new {level} test is closed-loop; {kind} tests are sil or dil"
        raise UsageError(f"{reason}; try: dodo new {name} --kind {kind}")
    needs = "a recording" if level == "dil" else "the true boxes of its pictures"
    raise UsageError(
        f"a {level} test of kind {kind} needs {needs}; copy a shipped test: dodo new {name} --extends {shipped}"
    )


def extending_files(name: str, base: Spec, root: Path) -> list[New]:
    """A spec that extends ``base``, in its registry, and a README."""
    path = base.path.relative_to(base.location.root.resolve()).as_posix()
    text = _filled("tests/extends.dodo.yml", name=name, base=path, description=f"As {base.name}, but ...")
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
    readme = _filled("tests/README.md", name=name, description=description[1] if description else "")
    return [New(folder / f"{name}{SUFFIX}", _schema_line(folder, root) + text), New(folder / "README.md", readme)]


def _schema_line(folder: Path, root: Path) -> bytes:
    """The line that tells an editor the schema, if the repository has it."""
    for place in (SCHEMAS, "schemas"):
        schema = root / place / "dodo.schema.json"
        if schema.is_file():
            return f"# yaml-language-server: $schema={Path(os.path.relpath(schema, folder)).as_posix()}\n".encode()
    return b""


def deployment_files(root: Path) -> list[New]:
    """dodo.yml, the application's compose file if there is none, the pipeline with its templates, and schemas."""
    application = next((name for name in COMPOSE_FILES if (root / name).is_file()), COMPOSE_FILES[0])
    pipelines = sorted((package_data.templates() / "gitlab").iterdir())
    schemas = [package_data.schemas() / f"{name}.schema.json" for name in ("deployment", "dodo")]
    return [
        New(root / FILE_NAME, _filled("deployment/dodo.yml", application=application)),
        New(root / application, _filled("deployment/docker-compose.yml")),
        New(root / "tests" / "README.md", _filled("deployment/tests.md")),
        New(root / ".gitlab-ci.yml", _filled("deployment/gitlab-ci.yml")),
        *(New(root / ".gitlab" / "dodo" / path.name, path.read_bytes()) for path in pipelines),
        *(New(root / SCHEMAS / path.name, path.read_bytes()) for path in schemas),
        New(root / ".gitignore", _filled("deployment/gitignore")),
    ]
