"""Service manifests: a service with its layers, parameters and ports."""

import functools
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.diagnostics import Diagnostic, Span, has_errors, shown_path
from dodo_dsl.source import Mapping, Reader, plain, read
from dodo_dsl.spec import manifest_consistency
from dodo_dsl.spec.schema.validation import validate

Value = str | int | float | bool | list[str | int | float] | None


@dataclass(frozen=True)
class Parameter:
    """A service's parameter; ``unit`` is the unit of the flag's number, empty for a bare number.

    ``rig`` is the dotted key of the rig's setting that is the default; ``among`` names a path parameter and a list of
    its JSON file (``map-path.obstacles``), whose entries' names are the allowed values; ``within_timeout`` marks a
    duration that must be shorter than the test's timeout; one with ``setup_times`` may pass that many times before the
    service is ready; ``not_empty`` names lists of a JSON file that must not be empty; ``format`` says what is in the
    file that a path names, which is checked as the service reads it.
    """

    name: str
    type: str
    help: str
    unit: str = ""
    default: Value = None
    required: bool = False
    shared: bool = False
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    rig: str = ""
    among: str = ""
    not_empty: tuple[str, ...] = ()
    format: str = ""
    within_timeout: bool = False
    setup_times: int = 0
    example: Value = None


@dataclass(frozen=True)
class Ports:
    """Names that a service reads (``inputs``) and writes (``outputs``); ``{parameter}`` is replaced by its value."""

    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Manifest:
    """One service; ``folder`` holds its ``service.yml``. ``example`` has flags to run it alone with, or is None.

    A test gives at least one parameter of each group in ``one_of``. ``checks`` are the units of an evaluator's checks
    by patterns of their names, empty where it does not tell.
    """

    folder: Path
    name: str
    layers: tuple[str, ...]
    image: str
    process: tuple[str, ...]
    description: str
    parameters: dict[str, Parameter] = field(default_factory=dict)
    messages: Ports = Ports()
    memory: Ports = Ports()
    devices: tuple[str, ...] = ()
    example: tuple[str, ...] | None = None
    one_of: tuple[tuple[str, ...], ...] = ()
    checks: dict[str, str] = field(default_factory=dict)

    @property
    def has_own_image(self) -> bool:
        """Whether its image has the deployment's prefix and tag, and none that is written in full."""
        return "/" not in self.image and ":" not in self.image


def _ports(raw: dict[str, list[str]] | None) -> Ports:
    raw = raw or {}
    return Ports(tuple(raw.get("in", ())), tuple(raw.get("out", ())))


def load_manifest(path: Path, reader: Reader = read) -> tuple[Manifest | None, list[Diagnostic]]:
    """The manifest of a ``service.yml`` and its problems."""
    node, found = reader(path)
    if node is None and not found:
        found = [Diagnostic(Span(str(path)), "missing-key", "the file is empty, expected a service's manifest")]
    if node is not None:
        found = [*found, *validate(node, "service")]
    if isinstance(node, Mapping) and not has_errors(found):
        found = [*found, *manifest_consistency.problems(node)]
    if node is None or has_errors(found):
        return None, found
    raw = plain(node)
    parameters = {
        name: Parameter(
            name,
            within_timeout=p.get("within-timeout", False),
            setup_times=p.get("setup-times", 0),
            choices=tuple(p.get("choices", ())),
            not_empty=tuple(p.get("not-empty", ())),
            **{k: v for k, v in p.items() if k not in ("within-timeout", "setup-times", "choices", "not-empty")},
        )
        for name, p in (raw.get("parameters") or {}).items()
    }
    manifest = Manifest(
        folder=path.parent,
        name=raw["name"],
        layers=tuple(raw["layers"]),
        image=raw["image"],
        process=tuple(raw["process"]),
        description=raw["description"],
        parameters=parameters,
        messages=_ports(raw.get("messages")),
        memory=_ports(raw.get("memory")),
        devices=tuple(raw.get("devices") or ()),
        example=tuple(raw["example"]) if "example" in raw else None,
        one_of=tuple(tuple(names) for names in raw.get("one-of", ())),
        checks=raw.get("checks") or {},
    )
    return manifest, found


@functools.cache
def load_manifests(
    folders: tuple[Path, ...] = (), reader: Reader = read
) -> tuple[dict[str, Manifest], tuple[Diagnostic, ...]]:
    """Every manifest ``<folder>/<service>/service.yml``, by service name: the shipped ones and those of ``folders``."""
    manifests: dict[str, Manifest] = {}
    found: list[Diagnostic] = []
    for folder in (package_data.services(), *folders):
        for path in sorted(folder.glob("*/service.yml")):
            manifest, problems = load_manifest(path, reader)
            found.extend(problems)
            if manifest and manifest.name in manifests:
                other = manifests[manifest.name].folder
                is_shipped = other.parent == package_data.services()
                owner = "a service of DoDo" if is_shipped else f"the service in {shown_path(str(other))}"
                message = f"the name '{manifest.name}' is taken by {owner}"
                found.append(Diagnostic(Span(str(path)), "name-taken", message, "choose another name"))
            elif manifest:
                manifests[manifest.name] = manifest
                found.extend(manifest_consistency.name_problems(manifest.name, path))
    return manifests, tuple(found)
