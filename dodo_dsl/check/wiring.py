"""The wiring of a test: what its services produce and consume, and what is required of the application."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import product
from typing import Literal

from dodo_dsl.application.model import Declared
from dodo_dsl.check.ros_topics import Resolved, Sources
from dodo_dsl.diagnostics import Span
from dodo_dsl.opendlv.address import is_of_the_world
from dodo_dsl.spec.arguments import ResolvedService
from dodo_dsl.spec.manifest import Ports

Kind = Literal["message", "memory"]

ANYTHING = "*"
NO_TYPES: Mapping[str, Collection[str]] = {}
_KINDS: tuple[Kind, ...] = ("message", "memory")

_PARAMETER = re.compile(r"\{(?P<name>[^{}]+)\}")
_STAMP = re.compile(r"[0-9]{1,10}")


@dataclass(frozen=True)
class Port:
    """A message or memory that a service produces or consumes, or only may where it is ``optional``.

    ``stamp`` is a message's sender stamp; with None a service consumes any. A service judges the application by what it
    consumes as ``truth``.
    """

    kind: Kind
    name: str
    stamp: int | None = None
    optional: bool = False
    truth: bool = False

    def __str__(self) -> str:
        return self.name if self.stamp is None else f"{self.name}/{self.stamp}"

    def consumes(self, other: "Port") -> bool:
        if other.name == ANYTHING:
            return True
        same = (self.kind, self.name) == (other.kind, other.name)
        return same and (self.stamp is None or other.stamp is None or self.stamp == other.stamp)

    @property
    def can_be_required(self) -> bool:
        """Whether an application could produce it."""
        return self.kind == "memory" or not is_of_the_world(self.name)


@dataclass(frozen=True)
class End:
    """A port of a service; ``layer`` is "application" for one of the application's.

    One that is ``instead`` stands for all others that the service requires of the application.
    """

    service: str
    layer: str
    port: Port
    span: Span
    instead: bool = False

    @property
    def is_asked(self) -> bool:
        """Whether it is a message that only the application could send."""
        return self.port.kind == "message" and self.port.can_be_required


@dataclass(frozen=True)
class Wiring:
    """Everything produced and consumed in a test.

    ``undeclared`` names the application's services without x-dodo, ``answers`` and ``done`` are the messages that
    they declare to complete a frame in lockstep, ``printed`` those that are lines of theirs. ``unsent`` are services
    that may send anything by their manifests, and messages that they cannot send. ``alternatives`` are messages that
    stand for others, consumed only if the application declares that it sends them. ``topics`` are those of ROS nodes.
    """

    produced: tuple[End, ...]
    consumed: tuple[End, ...]
    application_produces: tuple[End, ...] = ()
    application_consumes: tuple[End, ...] = ()
    undeclared: tuple[str, ...] = ()
    has_application: bool = False
    answers: tuple[End, ...] = ()
    done: str = ""
    unsent: frozenset[tuple[str, str]] = frozenset()
    printed: tuple[End, ...] = ()
    topics: tuple[Resolved, ...] = ()
    alternatives: tuple[End, ...] = ()

    def producers(self, port: Port) -> list[End]:
        found = [end for end in self.produced if port.consumes(end.port)]
        return [end for end in found if end.port.name != ANYTHING or (end.service, str(port)) not in self.unsent]

    def is_truth(self, port: Port) -> bool:
        """Whether the application is judged by it, and services of the test produce it."""
        return port.truth and bool(self.producers(port))

    def judges_by(self, port: Port) -> str:
        """The service that judges the application by a message; empty if none does."""
        found = (end.service for end in self.consumed if self.is_truth(end.port) and end.port.consumes(port))
        return next(found, "")

    def application_may_produce(self, port: Port) -> bool:
        """Whether the application declares it, or could produce it because it does not declare everything."""
        if not port.can_be_required:
            return False
        open_ended = not self.has_application or bool(self.undeclared) or port.kind == "memory"
        return open_ended or any(port.consumes(end.port) for end in self.application_produces)

    def required(self) -> list[End]:
        return [end for end in self.consumed if not self.producers(end.port)]


def wire(
    services: Sequence[ResolvedService],
    declared: Mapping[str, Declared | None] | None,
    types: Mapping[str, Collection[str]] = NO_TYPES,
) -> Wiring:
    """The wiring of one instance, as far as its arguments fit; ``declared`` is None without an application.

    ``types`` are ROS types of the team's own, each with its fields.
    """
    produced: list[End] = []
    consumed: list[End] = []
    for service in services:
        use, manifest = service.use, service.manifest
        kinds: tuple[tuple[Kind, Ports], ...] = (("message", service.messages), ("memory", manifest.memory))
        for kind, ports in kinds:
            produced += [End(use.name, use.layer, p, use.span) for p in _ports(kind, ports.outputs, service, 0)]
            inputs = _ports(kind, ports.inputs, service, None)
            consumed += [End(use.name, use.layer, p, use.span, p.name in manifest.instead) for p in inputs]
    made = {kind: tuple((str(e.port), e.service) for e in produced if e.port.kind == kind) for kind in _KINDS}
    sources = Sources(tuple(services), made["memory"], made["message"], types)
    return _with_alternatives(_with_application(Wiring(tuple(produced), tuple(consumed)), declared, sources))


def _with_alternatives(wiring: Wiring) -> Wiring:
    """Without alternatives that the application does not declare; what those that it declares stand for is optional."""
    sent = [end.port for end in wiring.application_produces]
    alternatives = tuple(end for end in wiring.consumed if end.instead)
    declared = {end for end in alternatives if any(map(end.port.consumes, sent))}
    freed = {end.service for end in declared}
    consumed = (
        replace(end, port=replace(end.port, optional=True)) if end.service in freed and end.is_asked else end
        for end in wiring.consumed
        if not end.instead or end in declared
    )
    return replace(wiring, consumed=tuple(consumed), alternatives=alternatives)


def _ports(kind: Kind, written: Sequence[str], service: ResolvedService, stamp: int | None) -> Iterator[Port]:
    for text in written:
        values = {m["name"]: service.filling(m["name"]) for m in _PARAMETER.finditer(text)}
        if None in values.values():
            continue  # an optional parameter without a value: no such port
        truth = text.endswith("!")
        optional = text.removesuffix("!").endswith("?")
        filled = [_filled(part, values) for part in text.rstrip("?!").split("/", 1)]
        if kind == "memory":
            yield Port(kind, "/".join(filled).removeprefix("/"), None, optional)
        else:  # a list has commas
            parts = ("/".join(pair) for pair in product(*(part.split(",") for part in filled)))
            yield from (message(each, stamp, optional, truth) for each in parts if each)


def _filled(text: str, values: Mapping[str, str | None]) -> str:
    return _PARAMETER.sub(lambda match: values[match["name"]] or "", text)


def message(text: str, stamp: int | None, optional: bool = False, truth: bool = False) -> Port:
    """The port of ``name`` or ``name/senderStamp``; ``stamp`` is that of a name alone."""
    name, _, number = text.partition("/")
    return Port("message", name, int(number) if _STAMP.fullmatch(number) else stamp, optional, truth)


def _with_application(wiring: Wiring, declared: Mapping[str, Declared | None] | None, sources: Sources) -> Wiring:
    if declared is None:
        return wiring
    topics = sources.resolve(declared)
    produced: list[End] = []
    consumed: list[End] = []
    answers: list[End] = []
    for service, own in declared.items():
        for ends, names in ((produced, own.outputs), (consumed, own.inputs), (answers, own.answers)) if own else ():
            stamp = 0 if ends is produced else None
            ends += [End(service, "application", message(name, stamp), span) for name, span in names]
    for topic in topics:
        kind: Kind = "memory" if topic.is_picture else "message"
        for name in topic.bus if topic.written.given else ():
            port = Port(kind, name) if topic.is_picture else message(name, None)
            consumed.append(End(topic.service, "application", port, topic.written.span))
    printed = (
        End(service, "application", message(line.port, 0), line.message_span)
        for service, own in declared.items()
        for line in (own.lines if own else ())
    )
    ending = [own.done[0] for own in declared.values() if own and own.done]
    return replace(
        wiring,
        done=ending[0] if ending else "",
        application_produces=tuple(produced),
        application_consumes=tuple(consumed),
        answers=tuple(answers),
        undeclared=tuple(s for s, own in declared.items() if own is None),
        has_application=True,
        printed=tuple(printed),
        topics=topics,
    )


DEFAULT_HZ = 10.0
DETECTIONS = "opendlv.logic.perception.Detection"
"""Prefix of messages that a frame may have any number of, so that they cannot complete an answer."""

_CLOSE = Decimal("1e-6")


def cameras_of(wiring: Wiring) -> set[str]:
    return {end.service for end in wiring.produced if end.port.kind == "memory"}


def rates(services: Iterable[ResolvedService]) -> dict[str, float]:
    """The rates in Hz of the services that have one, by name in the test."""
    found = {}
    for service in services:
        text = service.texts.get("freq")
        if text is not None and service.manifest.parameters["freq"].unit == "Hz":
            found[service.use.name] = float(text)
    return found


def step_hz(wiring: Wiring, rates: Mapping[str, float]) -> float:
    """Steps per second: the rate of the fastest camera, or else of the fastest service that the application hears.

    ``rates`` are the services' in Hz.
    """
    sources = cameras_of(wiring) or {
        e.service for e in wiring.produced if any(i.port.consumes(e.port) for i in wiring.application_consumes)
    }
    return max((rates[name] for name in sources if name in rates), default=DEFAULT_HZ)


def rates_fit(rate: float, step: float) -> bool:
    """Whether a rate is a whole multiple or a whole fraction of the steps', both in Hz."""
    high, low = (Decimal(str(limit(rate, step))) for limit in (max, min))
    times = high / low
    return abs(times - round(times)) < _CLOSE


def answers(wiring: Wiring) -> list[str]:
    """The messages that answer a frame, each once: those that the application declares, else those that drive the
    vehicle, else those that are judged, and what it prints; empty without any."""
    expected = _expected(wiring)
    driven = [end for end in expected if end.layer == "action"]
    judged = [e for e in expected if e.layer == "evaluation" and not e.port.name.startswith(DETECTIONS)]
    chosen = driven or judged
    printed = [end for end in wiring.printed if not end.port.name.startswith(DETECTIONS)]
    missing = [end for end in printed if not any(each.port.consumes(end.port) for each in chosen)]
    return _names(wiring.answers) or _names([*chosen, *missing])


def driving(wiring: Wiring) -> list[str]:
    return _names(end for end in _expected(wiring) if end.layer == "action")


def _expected(wiring: Wiring) -> list[End]:
    """What the application has to produce: an optional message only when it declares that it does."""
    sent = [other.port for other in wiring.application_produces]
    return [e for e in _from_application(wiring) if not e.port.optional or any(map(e.port.consumes, sent))]


def other_inputs(wiring: Wiring) -> list[str]:
    chosen = answers(wiring)
    return [name for name in _names(_from_application(wiring)) if name not in chosen]


def _from_application(wiring: Wiring) -> list[End]:
    """The inputs of services that only the application can feed."""
    return [
        end
        for end in wiring.consumed
        if end.port.kind == "message"
        and end.port.name != ANYTHING
        and end.port.can_be_required
        and not wiring.is_truth(end.port)
        and not any(end.port.consumes(other.port) for other in wiring.produced if other.port.name != ANYTHING)
    ]


def _names(ends: Iterable[End]) -> list[str]:
    """The messages by name, each once; a name alone means all its sender stamps."""
    ports = {end.port for end in ends}
    anybody = {port.name for port in ports if port.stamp is None}
    return sorted({str(port) for port in ports if port.stamp is None or port.name not in anybody})
