"""Service manifests: a service with its layers, parameters and ports, and rules that the schema cannot express.

``wrong-manifest``: what concerns two places of a manifest.
"""

import functools
import re
from collections.abc import Iterator
from collections.abc import Mapping as Map
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl import package_data
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, has_errors, shown_path
from dodo_dsl.source import Mapping, Node, Reader, Scalar, Sequence, plain, read, walk
from dodo_dsl.spec.validation import validate

RULE = "wrong-manifest"
RESERVED = ("cid", "help")

_PLACEHOLDER = re.compile(r"\{(?P<name>[^{}]*)\}")
FRAMES = re.compile(r"(?P<map>[a-z0-9-]+)\.frames")
"""A placeholder for the frames at which a map has models, as in ``{map-path.frames}``."""
_NUMBERS = ("number", "integer", "amount")
_TEXTS = ("string", "memory", "message", "output")
_DEFAULTS: dict[str, tuple[type, ...]] = {
    "number": (int, float),
    "amount": (int, float),
    "integer": (int,),
    "boolean": (bool,),
    "list": (list,),
    **dict.fromkeys(_TEXTS, (str,)),
}


def inconsistencies(node: Mapping) -> Iterator[Diagnostic]:
    """Problems of ports, defaults, bounds and references in a manifest that its schema accepts."""
    parameters = node.get("parameters")
    entries = parameters.entries if isinstance(parameters, Mapping) else {}
    types = {name: str(plain(entry.value)["type"]) for name, entry in entries.items()}
    for key in ("messages", "memory", "devices"):
        written = node.get(key)
        if written is not None:
            yield from _all_ports(written, types)
    messages = node.get("messages")
    cases = messages.get("cases") if isinstance(messages, Mapping) else None
    for item in cases.items if isinstance(cases, Sequence) else ():
        if isinstance(item, Mapping):
            yield from _conditions(item.get("when"), types)
    groups = node.get("one-of")
    for scalar in walk(groups) if groups is not None else ():
        if isinstance(scalar, Scalar) and scalar.text not in types:
            message = f"'one-of' names the unknown parameter '{scalar.text}'"
            yield Diagnostic(scalar.span, RULE, message, did_you_mean(scalar.text, types))
    for name, entry in entries.items():
        if name in RESERVED:
            message = f"'--{name}' is a flag of every service, so it cannot name a parameter"
            yield Diagnostic(entry.key, RULE, message, "choose another name")
        if isinstance(entry.value, Mapping):
            yield from _parameter(name, entry.value, types)


def _conditions(node: Node | None, types: dict[str, str]) -> Iterator[Diagnostic]:
    for name, entry in node.entries.items() if isinstance(node, Mapping) else ():
        if name not in types:
            yield Diagnostic(entry.key, RULE, f"'when' names the unknown parameter '{name}'", did_you_mean(name, types))


def _all_ports(node: Node, types: dict[str, str]) -> Iterator[Diagnostic]:
    for scalar in walk(node):
        if not isinstance(scalar, Scalar):
            continue
        for match in _PLACEHOLDER.finditer(scalar.text):
            frames = None if match["name"] in types else FRAMES.fullmatch(match["name"])
            for name in [match["name"]] if frames is None else filter(None, frames.groups()):
                if name not in types:
                    message = f"'{scalar.text}' names the unknown parameter '{name}'"
                    yield Diagnostic(scalar.span, RULE, message, did_you_mean(name, types))


_KINDS_OF_KEY: dict[str, tuple[tuple[str, ...], str]] = {
    "of": (("list",), "lists"),
    "per": (("list",), "lists"),
    "driving": (("list",), "lists"),
    "choices": (("string", "list"), "strings and lists"),
    "or-share": (("amount",), "amounts"),
    "not-empty": (("path",), "paths"),
    "format": (("path",), "paths"),
    "unit": (("number",), "numbers"),
    "minimum": (_NUMBERS, "numbers"),
    "maximum": (_NUMBERS, "numbers"),
}
"""Keys that only parameters of some types may have, with these types in words."""


def _parameter(name: str, node: Mapping, types: dict[str, str]) -> Iterator[Diagnostic]:
    raw = plain(node)
    kind = raw["type"]
    for key, (kinds, words) in _KINDS_OF_KEY.items():
        of_items = raw.get("of", kind) if words == "numbers" else kind
        if raw.get(key) not in (None, False) and of_items not in kinds:
            verb = "are" if key == "choices" else "is"
            yield _misplaced(node, key, f"'{key}' {verb} for {words}, but '{name}' is of type {kind}")
    for key in ("within-timeout", "setup-times"):
        if raw.get(key) and raw.get("unit") != "s":
            yield _misplaced(node, key, f"'{name}' is not a duration", "add 'unit: s'")
    if raw.get("minimum", 0) > raw.get("maximum", raw.get("minimum", 0)):
        yield _misplaced(node, "minimum", f"the minimum of '{name}' is larger than its maximum")
    source = str(raw.get("among", "")).partition(".")[0]
    for key, named, wanted in (("among", source, "path"), ("per", raw.get("per"), "list")):
        if named and types.get(named) != wanted:
            message = f"'{key}' names '{named}', expected a parameter of type {wanted}"
            yield _misplaced(node, key, message, did_you_mean(named, [n for n, t in types.items() if t == wanted]))
    yield from _conditions(node.get("when"), types)
    below = list(types)[list(types).index(name) :]
    for other in raw.get("when", {}):
        if other in below:
            yield _misplaced(node, "when", f"'{name}' is above '{other}', on which it depends", "put it below")
    yield from _default(name, node, raw)


def _default(name: str, node: Mapping, raw: dict[str, Any]) -> Iterator[Diagnostic]:
    if "default" not in raw:
        return
    kind, default = raw["type"], raw["default"]
    if kind == "path":
        yield _misplaced(node, "default", f"'{name}' is a path in a test, so it cannot have a default")
        return
    if not _is_of(kind, default) or ("of" in raw and not all(_is_of(raw["of"], item) for item in default)):
        yield _misplaced(node, "default", f"the default of '{name}' is not of type {kind}")
    elif kind in _NUMBERS and not raw.get("minimum", default) <= default <= raw.get("maximum", default):
        yield _misplaced(node, "default", f"the default of '{name}' is not between its minimum and its maximum")
    elif kind == "string" and default not in raw.get("choices", [default]):
        yield _misplaced(node, "default", f"the default of '{name}' is not one of its choices")


def _is_of(kind: str, value: object) -> bool:
    return isinstance(value, _DEFAULTS[kind]) and (kind == "boolean" or not isinstance(value, bool))


def _misplaced(node: Mapping, key: str, message: str, hint: str = "") -> Diagnostic:
    span: Span = node.entries[key].key
    return Diagnostic(span, RULE, message, hint)


Value = str | int | float | bool | list[str | int | float] | None

When = Map[str, tuple[str, ...]]
"""Parameters with the values that each may have, as texts; the empty one is for a parameter that is not given."""


def holds(when: When, texts: Map[str, str]) -> bool:
    """Whether the parameters with these values, as texts, are as ``when`` says."""
    return all(texts.get(name, "") in values for name, values in when.items())


def in_words(when: When) -> str:
    """``with drive: differential or bicycle``."""
    return "with " + " and ".join(f"{name}: {' or '.join(filter(None, values))}" for name, values in when.items())


def _when(raw: dict[str, list[str | bool]]) -> When:
    return {name: tuple(v if isinstance(v, str) else str(v).lower() for v in values) for name, values in raw.items()}


@dataclass(frozen=True)
class Parameter:
    """A service's parameter; ``unit`` is the unit of the flag's number, empty for a bare number.

    One that is ``shared`` has by default the value of the parameter of this name of another service of the test, or
    of the service that it names. ``rig`` is the dotted key of the rig's setting that is the default; ``among`` names
    a path parameter and lists of its JSON file (``map-path.obstacles``), whose entries' names are the allowed values,
    and so are ``words``; ``within_timeout`` marks a duration that must be shorter than the test's timeout; one with
    ``setup_times`` may pass that many times before the service is ready; ``not_empty`` names lists of a JSON file that
    must not be empty; ``format`` shows what is in the file that a path names, which is checked as the service reads it;
    an amount with ``or_share`` may be ``25 %``. Items of a list are strings, or numbers if ``of`` asks for them; it
    has as many of them as the list that ``per`` names, or one. It has an effect only ``when`` others are so. The
    messages that drive the vehicle take the place of the default of one that is ``driving``. ``deprecated`` is why.
    """

    name: str
    type: str
    help: str
    of: str = ""
    per: str = ""
    unit: str = ""
    default: Value = None
    required: bool = False
    shared: bool | str = False
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    rig: str = ""
    among: str = ""
    words: tuple[str, ...] = ()
    not_empty: tuple[str, ...] = ()
    format: str = ""
    within_timeout: bool = False
    setup_times: int = 0
    or_share: bool = False
    example: Value = None
    when: When = field(default_factory=dict)
    driving: bool = False
    deprecated: str = ""


@dataclass(frozen=True)
class Ports:
    """Names that a service reads (``inputs``) and writes (``outputs``); ``{parameter}`` is replaced by its value."""

    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def __add__(self, other: "Ports") -> "Ports":
        return Ports(self.inputs + other.inputs, self.outputs + other.outputs)


@dataclass(frozen=True)
class Case:
    """Ports that a service has ``when`` its parameters are so."""

    when: When
    ports: Ports


@dataclass(frozen=True)
class Manifest:
    """One service; ``folder`` holds its ``service.yml``. ``example`` has flags to run it alone with, or is None.

    A test gives at least one parameter of each group in ``one_of``. ``checks`` are the units of an evaluator's checks
    by patterns of their names, empty if it does not declare them. ``messages`` are those that it has whatever its
    parameters are, ``cases`` the others.
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
    cases: tuple[Case, ...] = ()

    def messages_with(self, texts: Map[str, str]) -> Ports:
        """The messages that it has where its parameters have these values, as texts."""
        return sum((case.ports for case in self.cases if holds(case.when, texts)), Ports()) + self.messages

    @property
    def all_messages(self) -> Ports:
        """The messages that it may have, whatever its parameters are."""
        return sum((case.ports for case in self.cases), Ports()) + self.messages

    @property
    def has_own_image(self) -> bool:
        """Whether its image has the deployment's prefix and tag, and none that is written in full."""
        return "/" not in self.image and ":" not in self.image


_TRANSLATED = ("within-timeout", "setup-times", "or-share", "choices", "words", "not-empty", "when")


def _ports(raw: dict[str, Any] | None) -> Ports:
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
        found = [*found, *inconsistencies(node)]
    if node is None or has_errors(found):
        return None, found
    raw = plain(node)
    parameters = {
        name: Parameter(
            name,
            within_timeout=p.get("within-timeout", False),
            setup_times=p.get("setup-times", 0),
            or_share=p.get("or-share", False),
            choices=tuple(p.get("choices", ())),
            words=tuple(p.get("words", ())),
            not_empty=tuple(p.get("not-empty", ())),
            when=_when(p.get("when", {})),
            **{k: v for k, v in p.items() if k not in _TRANSLATED},
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
        cases=tuple(Case(_when(case["when"]), _ports(case)) for case in (raw.get("messages") or {}).get("cases", ())),
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
    return manifests, tuple(found)
