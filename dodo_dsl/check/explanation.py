"""An instance explained: the origin of its services' values, its wiring, and what it requires."""

from collections.abc import Iterator
from dataclasses import dataclass

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.check.senders import told
from dodo_dsl.check.wiring import ANYTHING, End, Port, Wiring
from dodo_dsl.diagnostics import Span, shown_path
from dodo_dsl.source import Entry, Scalar
from dodo_dsl.spec import quantity
from dodo_dsl.spec.arguments import Argument, default_value
from dodo_dsl.spec.manifest import Parameter
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.rig import EMULATED_FILE


@dataclass(frozen=True)
class ArgumentExplained:
    """A parameter with its flag's value; ``origin`` is a position, "default", or the service or rig that gives it."""

    name: str
    value: str
    unit: str
    origin: str


@dataclass(frozen=True)
class RangeExplained:
    """What ``dodo search`` varies: ``values`` are the ends with "to" between them, or a list."""

    name: str
    nominal: str
    values: str
    origin: str


@dataclass(frozen=True)
class ServiceExplained:
    layer: str
    name: str
    uses: str
    arguments: tuple[ArgumentExplained, ...]


@dataclass(frozen=True)
class Line:
    """A message or memory with its producers and its consumers; services of the application are marked."""

    kind: str
    port: str
    says: tuple[str, ...]
    hears: tuple[str, ...]


@dataclass(frozen=True)
class Asked:
    """What the application must produce, or may produce if ``required`` is false."""

    kind: str
    port: str
    needed_by: tuple[str, ...]
    required: bool
    declared_by: tuple[str, ...]


@dataclass(frozen=True)
class Explanation:
    """The fields of ``dodo explain --json``.

    ``pool`` is what the test says of the rigs that will do, ``rig`` that of this instance. ``variables`` are those that
    the test sets for the application, whose services without x-dodo ``undeclared`` names. ``told`` is what it gets of
    what only a simulation has.
    """

    name: str
    slug: str
    file: str
    level: str
    kind: str
    rig: str
    pool: str
    services: tuple[ServiceExplained, ...]
    variables: tuple[ArgumentExplained, ...]
    vary: tuple[RangeExplained, ...]
    wiring: tuple[Line, ...]
    asked: tuple[Asked, ...]
    told: tuple[str, ...]
    has_application: bool
    undeclared: tuple[str, ...]


def explain(test: ResolvedTest) -> Explanation:
    """One instance, as far as it can be read."""
    spec, wiring = test.spec, test.wiring
    return Explanation(
        spec.title,
        spec.slug,
        shown_path(str(spec.path)),
        spec.level or "?",
        spec.kind or "?",
        spec.rig or "",
        spec.pool,
        tuple(_service(test, use) for use in spec.uses),
        tuple(_variable(name, entry) for name, entry in spec.variables.items()),
        tuple(RangeExplained(one.name, one.nominal.text, one.text, _place(one.nominal.span)) for one in spec.ranges),
        tuple(_lines(wiring)),
        tuple(_asked(wiring)),
        tuple(dict.fromkeys(str(end.port) for end in told(wiring))),
        wiring.has_application,
        wiring.undeclared,
    )


def _service(test: ResolvedTest, use: Use) -> ServiceExplained:
    service = next((s for s in test.services if s.use is use), None)
    given = service.arguments.values() if service else ()
    shown = tuple(_argument(test.spec, use, argument) for argument in given if argument.value or argument.problem)
    return ServiceExplained(use.layer, use.name, use.uses.text, shown)


def _variable(name: str, entry: Entry) -> ArgumentExplained:
    value = entry.value.text if isinstance(entry.value, Scalar) else "?"
    return ArgumentExplained(name, value, "", _place(entry.key))


def _place(span: Span) -> str:
    return f"{shown_path(span.file)}:{span.line}"


def _argument(spec: Spec, use: Use, argument: Argument) -> ArgumentExplained:
    parameter = argument.parameter
    if argument.value is None:
        return ArgumentExplained(parameter.name, "?", "", "does not fit")
    unit = "" if parameter.unit == quantity.SHARE else parameter.unit
    return ArgumentExplained(parameter.name, argument.value.text, unit, _origin(spec, use, argument))


def _origin(spec: Spec, use: Use, argument: Argument) -> str:
    entry = argument.entry
    if entry is None:
        is_default = argument.value == default_value(argument.parameter)
        return "default" if is_default else "what vehicle or application take"
    place = _place(entry.key)
    if argument.parameter.name in use.parameters:
        return place
    if entry.key.file == EMULATED_FILE:
        return EMULATED_FILE
    giver = _giver(spec, use, argument.parameter)
    return f"as {giver}, {place}" if giver else f"rig {spec.rig}, {place}"


def _giver(spec: Spec, use: Use, parameter: Parameter) -> str:
    if not parameter.shared:
        return ""
    return next((u.name for u in spec.uses if u is not use and parameter.name in u.parameters), "")


def _shown(end: End) -> str:
    return f"{end.service} (application)" if end.layer == "application" else end.service


def _sender(end: End, wiring: Wiring) -> str:
    """A producer, and whether it only prints the message."""
    is_printed = any((each.service, each.port) == (end.service, end.port) for each in wiring.printed)
    return f"{end.service} (application, prints it)" if is_printed else _shown(end)


def _lines(wiring: Wiring) -> Iterator[Line]:
    consumers = (*wiring.consumed, *wiring.application_consumes)
    produced: dict[Port, list[End]] = {}
    for end in (*wiring.produced, *wiring.application_produces):
        produced.setdefault(end.port, []).append(end)
    for port, ends in produced.items():
        anything = port.name == ANYTHING
        by = {_shown(c): None for c in consumers if c.port.consumes(port) and (not anything or _only(wiring, c))}
        name = "any message of it" if anything else str(port)
        yield Line(port.kind, name, tuple(_sender(end, wiring) for end in ends), tuple(by))
    unsatisfied: dict[str, list[End]] = {}
    for end in consumers:
        if not any(end.port.consumes(port) for port in produced):
            unsatisfied.setdefault(f"{end.port.kind} {end.port}", []).append(end)
    for ends in unsatisfied.values():
        yield Line(ends[0].port.kind, str(ends[0].port), (), tuple(map(_shown, ends)))


def _only(wiring: Wiring, end: End) -> bool:
    """Whether no service of the test produces by name what the end consumes."""
    return all(producer.port.name == ANYTHING for producer in wiring.producers(end.port))


def _asked(wiring: Wiring) -> Iterator[Asked]:
    by_port: dict[str, list[End]] = {}
    for end in wiring.required():
        if end.port.can_be_required:
            by_port.setdefault(f"{end.port.kind} {end.port}", []).append(end)
    for ends in by_port.values():
        port = ends[0].port
        declared = {e.service: None for e in wiring.application_produces if port.consumes(e.port)}
        needed = tuple(e.service for e in ends)
        yield Asked(port.kind, str(port), needed, any(not e.port.optional for e in ends), tuple(declared))
