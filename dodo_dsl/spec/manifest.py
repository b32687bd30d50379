"""Service manifests: a service with its layers, parameters and ports, and rules that the schema cannot express."""

import functools
import re
from collections.abc import Iterator
from collections.abc import Mapping as Map
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from dodo_dsl import package_data
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, has_errors, shown_path
from dodo_dsl.source import Mapping, Node, Scalar, Sequence, entries, part, plain, read, walk
from dodo_dsl.spec.quantity import SHARE
from dodo_dsl.spec.validation import validate

MANIFEST = "service.yml"
RULE = "wrong-manifest"
RESERVED = ("cid", "help")

_PLACEHOLDER = re.compile(r"\{(?P<name>[^{}]*)\}")
FRAMES = re.compile(r"(?P<map>[a-z0-9-]+)\.frames")
"""A placeholder for the frames at which a map has models, as in ``{map-path.frames}``."""


def inconsistencies(node: Mapping) -> Iterator[Diagnostic]:
    """Problems of references and defaults in a manifest that its schema accepts."""
    parameters = entries(node, "parameters")
    cases = part(node, "messages", "cases")
    above = [*(entry.value for entry in parameters.values()), *(cases.items if isinstance(cases, Sequence) else ())]
    named = [(each.span, "one-of", each.text) for each in _scalars(node.get("one-of"))]
    named += [(entry.key, "when", name) for each in above for name, entry in entries(each, "when").items()]
    for entry in parameters.values():
        words = ((key, part(entry.value, key)) for key in ("among", "per"))
        named += [(w.span, key, w.text.partition(".")[0]) for key, w in words if isinstance(w, Scalar)]
    for port in (each for key in ("messages", "memory", "devices") for each in _scalars(node.get(key))):
        for match in _PLACEHOLDER.finditer(port.text):
            frames = None if match["name"] in parameters else FRAMES.fullmatch(match["name"])
            named.append((port.span, port.text, frames["map"] if frames else match["name"]))
    for span, what, name in named:
        if name not in parameters:
            message = f"'{what}' names the unknown parameter '{name}'"
            yield Diagnostic(span, RULE, message, did_you_mean(name, parameters))
    for name, entry in parameters.items():
        if name in RESERVED:
            message = f"'--{name}' is a flag of every service, so it cannot name a parameter"
            yield Diagnostic(entry.key, RULE, message, "choose another name")
        keys, raw = entries(entry.value), plain(entry.value)
        for key in keys.keys() & {"within-timeout", "setup-times"}:
            if raw[key] and (raw["type"], raw.get("unit")) != ("number", "s"):
                yield Diagnostic(keys[key].key, RULE, f"'{name}' is not a duration", "write 'type: number, unit: s'")
        if "default" in keys and (message := _problem_of_default(name, raw, keys["default"].value)):
            yield Diagnostic(keys["default"].key, RULE, message)


def _scalars(node: Node | None) -> list[Scalar]:
    return [each for each in walk(node) if isinstance(each, Scalar)] if node is not None else []


def _problem_of_default(name: str, raw: dict[str, Any], node: Node) -> str:
    from dodo_dsl.spec.arguments import ValueProblem, convert

    if raw["type"] == "path":
        return f"'{name}' is a path in a test, so it cannot have a default"
    try:
        convert(replace(_read(name, raw), unit=""), node, Path())
    except ValueProblem as problem:
        return f"the default does not fit: {problem}"
    return ""


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
    ``setup_times`` may pass that many times before the service is ready;
    ``format`` shows what is in the file that a path names, which is checked as the service reads it;
    an amount with ``or_share`` may be ``25 %``. Items of a list are strings, or numbers if ``of`` asks for them; it
    has as many of them as the list that ``per`` names, or one. It has an effect only ``when`` others are so. The
    messages that drive the vehicle take the place of the default of one that is ``driving``, and goals and gates of the
    test's evaluators that of one that is ``judged``. ``deprecated`` is why.
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
    multiple_of: int = 1
    choices: tuple[str, ...] = ()
    rig: str = ""
    among: str = ""
    words: tuple[str, ...] = ()
    format: str = ""
    within_timeout: bool = False
    setup_times: int = 0
    or_share: bool = False
    example: Value = None
    when: When = field(default_factory=dict)
    driving: bool = False
    judged: bool = False
    deprecated: str = ""

    @property
    def bounds(self) -> str:
        """The numbers that it may have, as ``0.1 to 1000 Hz`` or ``at least 1``; empty for any."""
        low, high, unit = self.minimum, self.maximum, f" {self.unit}" if self.unit not in ("", SHARE) else ""
        if low is not None and high is not None:
            return f"{low:.10g} to {high:.10g}{unit}"
        ends = (("at least", low), ("at most", high))
        return next((f"{word} {end:.10g}{unit}" for word, end in ends if end is not None), "")


@dataclass(frozen=True)
class Ports:
    """Names that a service reads (``inputs``) and writes (``outputs``); ``{parameter}`` is replaced by its value."""

    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def __add__(self, other: "Ports") -> "Ports":
        return Ports(self.inputs + other.inputs, self.outputs + other.outputs)


@dataclass(frozen=True)
class Case:
    when: When
    ports: Ports


@dataclass(frozen=True)
class Manifest:
    """One service; ``folder`` holds its ``service.yml``. ``example`` has flags to run it alone with, or is None.

    A test gives at least one parameter of each group in ``one_of``. ``checks`` are the units of an evaluator's checks
    by patterns of their names, empty if it does not declare them. ``messages`` are those that it has whatever its
    parameters are, ``cases`` the others; an application that sends one of ``instead`` need not send what else it
    requires. DoDo adds an ``automatic`` one to tests itself.
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
    instead: tuple[str, ...] = ()
    automatic: bool = False

    def messages_with(self, texts: Map[str, str]) -> Ports:
        return sum((case.ports for case in self.cases if holds(case.when, texts)), Ports()) + self.messages

    @property
    def all_messages(self) -> Ports:
        return sum((case.ports for case in self.cases), Ports()) + self.messages

    @property
    def has_own_image(self) -> bool:
        """Whether its image has the deployment's prefix and tag, and none that is written in full."""
        return "/" not in self.image and ":" not in self.image


_LISTS = ("choices", "words")


def _read(name: str, raw: dict[str, Any]) -> Parameter:
    values: dict[str, Any] = {k.replace("-", "_"): tuple(v) if k in _LISTS else v for k, v in raw.items()}
    return Parameter(name, **{"help": "", **values, "when": _when(raw.get("when", {}))})


def _ports(raw: dict[str, Any]) -> Ports:
    return Ports(tuple(raw.get("in", ())), tuple(raw.get("out", ())))


def load_manifest(path: Path) -> tuple[Manifest | None, list[Diagnostic]]:
    node, found = read(path)
    if node is None and not found:
        found = [Diagnostic(Span(str(path)), "missing-key", "the file is empty, expected a service's manifest")]
    if node is not None:
        found = [*found, *validate(node, "service")]
    if isinstance(node, Mapping) and not has_errors(found):
        found = [*found, *inconsistencies(node)]
    return (None if node is None or has_errors(found) else _manifest(path.parent, plain(node))), found


def _manifest(folder: Path, raw: dict[str, Any]) -> Manifest:
    messages, memory = raw.pop("messages", {}), _ports(raw.pop("memory", {}))
    parameters = {name: _read(name, about) for name, about in raw.pop("parameters", {}).items()}
    cases = tuple(Case(_when(case["when"]), _ports(case)) for case in messages.get("cases", ()))
    facts = {key.replace("-", "_"): _fixed(value) for key, value in raw.items()}
    facts |= {"parameters": parameters, "memory": memory, "cases": cases, "instead": tuple(messages.get("instead", ()))}
    ports = _ports(messages) + Ports(tuple(f"{name}?" for name in facts["instead"]))
    return Manifest(folder, **facts, messages=ports)


def _fixed(value: Any) -> Any:
    return tuple(map(_fixed, value)) if isinstance(value, list) else value


class Manifests(Map[str, Manifest]):
    """Manifests by service name: a deployment's ``own``, and the shipped ones, each read when it is asked for."""

    def __init__(self, own: dict[str, Manifest]) -> None:
        files = package_data.services().glob(f"*/{MANIFEST}")
        self._shipped = {file.parent.name.replace("_", "-"): file for file in sorted(files)}
        self._own = own

    def __getitem__(self, name: str) -> Manifest:
        return self._own[name] if name in self._own else _shipped(self._shipped[name])

    def __iter__(self) -> Iterator[str]:
        return iter({**self._shipped, **self._own})

    def __len__(self) -> int:
        return len({**self._shipped, **self._own})


@functools.cache
def _shipped(file: Path) -> Manifest:
    node, _ = read(file)
    assert node is not None, "tests validate what ships"
    return _manifest(file.parent, plain(node))


@functools.cache
def load_manifests(folders: tuple[Path, ...] = ()) -> tuple[Manifests, tuple[Diagnostic, ...]]:
    """Every manifest ``<folder>/<service>/service.yml``, shipped ones and those of ``folders``, and their problems."""
    own: dict[str, Manifest] = {}
    known, found = Manifests(own), list[Diagnostic]()
    for path in (path for folder in folders for path in sorted(folder.glob(f"*/{MANIFEST}"))):
        manifest, problems = load_manifest(path)
        found.extend(problems)
        if manifest and manifest.name in known:
            is_own = manifest.name in own
            owner = f"the service in {shown_path(str(own[manifest.name].folder))}" if is_own else "a service of DoDo"
            message = f"the name '{manifest.name}' is taken by {owner}"
            found.append(Diagnostic(Span(str(path)), "name-taken", message, "choose another name"))
        elif manifest:
            own[manifest.name] = manifest
    return known, tuple(found)
