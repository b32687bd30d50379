"""What ``dodo new`` writes for a new test: from a template, as a copy of a shipped test, or extending another one.

The level and the kind say which. A copy of a shipped test is in the user's registry, if it can be changed.
"""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from dodo_dsl import package_data
from dodo_dsl.check import file_rules
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.existing_application import Pictures
from dodo_dsl.cli.new_files import New, filled, schema_of_specs
from dodo_dsl.diagnostics import did_you_mean
from dodo_dsl.source import Mapping as Written
from dodo_dsl.source import plain, read
from dodo_dsl.spec import load, vary
from dodo_dsl.spec.arguments import ValueProblem, convert
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import LAYERS, LEVELS, Spec
from dodo_dsl.spec.registry import KEYWORDS, SUFFIX

MAPS = ("maps/straight", "maps/rig-straight")
TARGET = "targets/weave.csv"

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


def test_files(
    name: str,
    template: str,
    registry: Path,
    root: Path,
    pictures: Pictures = Pictures(),  # noqa: B008  (it is frozen)
) -> list[New]:
    """A spec that compiles, its README, and the map or target that it needs where the registry has none."""
    folder = registry / name
    service = "camera" if template.startswith("tests/hil") else "virtual-camera"
    memories = "".join(f", {key}: {name}" for key, name in pictures.parameters(service).items())
    spec = filled(template, name=name, pictures=pictures, memories=memories)
    files = [*spec_files(name, folder, root, spec)]
    for place in MAPS:
        if f"../{place}".encode() in spec and not (registry / place).exists():
            shipped = sorted((package_data.registry() / place).iterdir())
            files += [New(registry / place / path.name, path.read_bytes()) for path in shipped]
    if f"../{TARGET}".encode() in spec and not (registry / TARGET).exists():
        files.append(New(registry / TARGET, filled("tests/weave.csv")))
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
    raise UsageError(f"unknown test '{name}' to extend" + (f"; {hint}" if hint else ""))


def spec_files(name: str, folder: Path, root: Path, text: bytes) -> list[New]:
    """A test's folder: the spec, with the line by which editors know its schema, and a README."""
    description = re.search(r"^description: (.*)$", text.decode(), re.MULTILINE)
    readme = filled("tests/README.md", name=name, description=description[1] if description else "")
    return [New(folder / f"{name}{SUFFIX}", _schema_line(folder, root) + text), New(folder / "README.md", readme)]


def _schema_line(folder: Path, root: Path) -> bytes:
    """The line that names the schema for an editor."""
    schema = Path(os.path.relpath(schema_of_specs(root), folder)).as_posix()
    return f"# yaml-language-server: $schema={schema}\n".encode()


LEVEL, KIND = "sil", "closed-loop"
"""Of a test for which none is named."""
_SHIPPED = {
    ("sil", "perception"): ("sil-perception", "needs the true boxes of its pictures"),
    ("dil", "open-loop"): ("dil-kiwi-track", "needs a recording"),
    ("dil", "perception"): ("dil-static-rig", "needs a recording"),
    ("hil", "open-loop"): ("hil-open-straight", "needs a path of its rig"),
    ("hil", "perception"): ("hil-camera", "needs the true boxes of its pictures"),
}
"""Shipped tests to copy for kinds that need more than a spec, and why."""


@dataclass(frozen=True)
class Start:
    """``template`` is empty if ``shipped`` is copied, for the reason ``why``."""

    level: str
    kind: str
    template: str = ""
    shipped: str = ""
    why: str = ""


def start(level: str, kind: str, name: str = "NAME") -> Start:
    """What the test ``name`` begins with; raises UsageError if none can have the level and the kind."""
    if (level, kind) == ("dil", "closed-loop"):
        reason = "a dil test cannot be closed-loop: what was recorded does not react to the application"
        raise UsageError(f"{reason}; try: dodo new {name} --level dil --kind open-loop")
    shipped, why = _SHIPPED.get((level, kind), ("", ""))
    if shipped:
        return Start(level, kind, shipped=shipped, why=why)
    return Start(level, kind, f"tests/{level}-{kind}{SUFFIX}")


def kinds(level: str) -> list[str]:
    """The kinds of a level, the usual one first."""
    templates = (package_data.templates() / "new/tests").glob(f"{level}-*{SUFFIX}")
    own = [path.name.removesuffix(SUFFIX).removeprefix(f"{level}-") for path in sorted(templates)]
    return [*own, *(kind for other, kind in _SHIPPED if other == level)]


def listing(shipped: Sequence[Spec]) -> str:
    """Everything that a new test may begin with, as text."""
    rows = []
    for found in (start(level, kind) for level in LEVELS for kind in kinds(level)):
        words = f"--level {found.level} --kind {found.kind}"
        default = " (what NAME alone writes)" if (found.level, found.kind) == (LEVEL, KIND) else ""
        rows.append((words, (f"a copy of {found.shipped}" if found.shipped else "a first test") + default))
    copies = [(f"--extends {spec.name}", spec.description or "") for spec in once(shipped)]
    return (
        "dodo new NAME writes a test, which begins as\n"
        + _table(rows)
        + "\nor, with --level dil --rec FILE.rec, as a test of your own recording\n"
        + "\nor as a copy of a test that ships with DoDo\n"
        + _table(copies)
        + "\ndodo new --application writes an application and a test that it passes, dodo new --deployment what a\n"
        + "repository needs besides its application and its tests; dodo new --help says more\n"
    )


def once(specs: Sequence[Spec]) -> list[Spec]:
    """The first instance of each test."""
    return list({spec.path: spec for spec in reversed(specs)}.values())[::-1]


def _table(rows: Sequence[tuple[str, str]]) -> str:
    width = max((len(words) for words, _ in rows), default=0)
    return "".join(f"  {words.ljust(width)}  {text}\n" for words, text in rows)


_COPIED_NAME = re.compile(r"^name: .*$", re.MULTILINE)
_EDITOR = re.compile(r"^# yaml-language-server:.*\n")


def copied_files(
    name: str, instances: Sequence[Spec], manifests: Mapping[str, Manifest], registry: Path, root: Path
) -> list[New]:
    """The test of ``instances`` as ``name`` in ``registry``, with the files that it needs and the registry lacks."""
    return [
        *spec_files(name, registry / name, root, _text(name, instances[0])),
        *_files(name, instances, manifests, registry),
    ]


def _text(name: str, base: Spec) -> bytes:
    """The spec's own text; one that extends others is resolved first, as the copy leaves them behind."""
    node, _ = read(base.path)
    text = base.path.read_text(encoding="utf-8")
    if isinstance(node, Written) and load.EXTENDS not in node.entries and len(_COPIED_NAME.findall(text)) == 1:
        return _COPIED_NAME.sub(f"name: {name}", _EDITOR.sub("", text)).encode()
    resolved = load.resolve(node, base.path, base.location.root)[0] if node else None
    if not isinstance(resolved, Written):
        raise UsageError(f"'{base.name}' cannot be read, so it cannot be copied")
    written = plain(resolved)
    used = vary.PLACEHOLDERS.used(resolved)
    ranges = {key: one for key, one in written.pop(vary.KEY, {}).items() if key in used}
    written |= {vary.KEY: ranges} if ranges else {}
    rest = {key: value for key, value in written.items() if key not in ("dodo", "name", *LAYERS)}
    keys = {"dodo": 1, "name": name, **rest, **{key: written[key] for key in LAYERS if key in written}}
    text = yaml.safe_dump(keys, sort_keys=False, default_flow_style=None, width=1000, allow_unicode=True)
    return str(text).encode()


def _files(name: str, instances: Sequence[Spec], manifests: Mapping[str, Manifest], registry: Path) -> Iterator[New]:
    """The files that the test names, each once; existing maps and recordings are kept, and its own are the copy's."""
    root = instances[0].location.root.resolve()
    own = instances[0].path.resolve().parent.relative_to(root)
    for path in dict.fromkeys(path for spec in instances for path in _paths(spec, manifests)):
        if (registry / path.relative_to(root)).exists() and not path.relative_to(root).is_relative_to(own):
            continue
        found = file_rules.files(path, root)
        if isinstance(found, str):
            raise UsageError(found)
        for target, source in zip(map(Path, found), found.values(), strict=True):
            place = Path(name) / target.relative_to(own) if target.is_relative_to(own) else target
            yield New(registry / place, source.read_bytes())


def _paths(spec: Spec, manifests: Mapping[str, Manifest]) -> Iterator[Path]:
    for use in spec.uses:
        parameters = manifests[use.uses.text].parameters if use.uses.text in manifests else {}
        for key, entry in use.parameters.items():
            if key not in parameters or parameters[key].type != "path":
                continue
            try:
                value = convert(parameters[key], entry.value, spec.location.root)
            except ValueProblem as problem:
                raise UsageError(problem.diagnostic.message) from problem
            if value.path is not None:
                yield value.path
