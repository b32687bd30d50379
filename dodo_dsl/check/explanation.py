"""An instance explained: its services with where each value comes from, its wiring, and what it asks for."""

from collections.abc import Iterator
from dataclasses import dataclass

from dodo_dsl.check.context import Context
from dodo_dsl.check.wiring import ANYTHING, End, Port, Wiring, wire
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.spec import arguments, quantity
from dodo_dsl.spec.manifest import Parameter
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.rig import EMULATED_FILE
from dodo_dsl.spec.values import ValueProblem


@dataclass(frozen=True)
class Argument:
    """A parameter with what its flag carries; ``origin`` is a place, "default", or who else it is taken from."""

    name: str
    value: str
    unit: str
    origin: str


@dataclass(frozen=True)
class ServiceExplained:
    layer: str
    name: str
    uses: str
    arguments: tuple[Argument, ...]


@dataclass(frozen=True)
class Line:
    """A message or memory with the names of who says and who hears it; services of the application have a mark."""

    kind: str
    port: str
    says: tuple[str, ...]
    hears: tuple[str, ...]


@dataclass(frozen=True)
class Asked:
    """What the application has to give, or only may where ``required`` is false."""

    kind: str
    port: str
    needed_by: tuple[str, ...]
    required: bool
    declared_by: tuple[str, ...]


@dataclass(frozen=True)
class Explanation:
    """``undeclared`` names services of the application that do not say what they send."""

    name: str
    slug: str
    file: str
    level: str
    kind: str
    rig: str
    services: tuple[ServiceExplained, ...]
    wiring: tuple[Line, ...]
    asked: tuple[Asked, ...]
    has_application: bool
    undeclared: tuple[str, ...]


def explain(context: Context) -> Explanation:
    """One instance, as far as it can be read."""
    spec, wiring = context.spec, wire(context)
    return Explanation(
        spec.title,
        spec.slug,
        shown_path(str(spec.path)),
        spec.level or "?",
        spec.kind or "?",
        spec.rig or "",
        tuple(_service(context, use) for use in spec.uses),
        tuple(_lines(wiring)),
        tuple(_asked(wiring)),
        wiring.has_application,
        wiring.undeclared,
    )


def _service(context: Context, use: Use) -> ServiceExplained:
    manifest = context.manifests.get(use.uses.text)
    parameters = manifest.parameters.values() if manifest else ()
    found = tuple(a for p in parameters if (a := _argument(context, use, p)) is not None)
    return ServiceExplained(use.layer, use.name, use.uses.text, found)


def _argument(context: Context, use: Use, parameter: Parameter) -> Argument | None:
    try:
        given = arguments.value(context.spec, use, parameter, context.rig)
    except ValueProblem:
        return Argument(parameter.name, "?", "", "does not fit")
    if given is None:
        return None
    unit = "" if parameter.unit == quantity.SHARE else parameter.unit
    return Argument(parameter.name, given.text, unit, _origin(context, use, parameter))


def _origin(context: Context, use: Use, parameter: Parameter) -> str:
    entry = arguments.written(context.spec, use, parameter, context.rig)
    if entry is None:
        return "default"
    place = f"{shown_path(entry.key.file)}:{entry.key.line}"
    if parameter.name in use.parameters:
        return place
    if entry.key.file == EMULATED_FILE:
        return EMULATED_FILE
    giver = _giver(context.spec, use, parameter)
    return f"as {giver}, {place}" if giver else f"rig {context.spec.rig}, {place}"


def _giver(spec: Spec, use: Use, parameter: Parameter) -> str:
    if not parameter.shared:
        return ""
    return next((u.name for u in spec.uses if u is not use and parameter.name in u.parameters), "")


def _shown(end: End) -> str:
    return f"{end.service} (application)" if end.layer == "application" else end.service


def _lines(wiring: Wiring) -> Iterator[Line]:
    hearers = (*wiring.heard, *wiring.application_hears)
    says: dict[Port, list[End]] = {}
    for end in (*wiring.said, *wiring.application_says):
        says.setdefault(end.port, []).append(end)
    for port, ends in says.items():
        by = {_shown(h): None for h in hearers if h.port.hears(port) and (port.name != ANYTHING or _only(wiring, h))}
        name = "any message of it" if port.name == ANYTHING else str(port)
        yield Line(port.kind, name, tuple(map(_shown, ends)), tuple(by))
    unsaid: dict[str, list[End]] = {}
    for end in hearers:
        if not any(end.port.hears(port) for port in says):
            unsaid.setdefault(f"{end.port.kind} {end.port}", []).append(end)
    for ends in unsaid.values():
        yield Line(ends[0].port.kind, str(ends[0].port), (), tuple(map(_shown, ends)))


def _only(wiring: Wiring, end: End) -> bool:
    """Whether nobody says by name what the end hears."""
    return all(said.port.name == ANYTHING for said in wiring.producers(end.port))


def _asked(wiring: Wiring) -> Iterator[Asked]:
    by_port: dict[str, list[End]] = {}
    for end in wiring.asked():
        if end.port.may_be_asked:
            by_port.setdefault(f"{end.port.kind} {end.port}", []).append(end)
    for ends in by_port.values():
        port = ends[0].port
        declared = {e.service: None for e in wiring.application_says if port.hears(e.port)}
        needed = tuple(e.service for e in ends)
        yield Asked(port.kind, str(port), needed, any(not e.port.optional for e in ends), tuple(declared))
