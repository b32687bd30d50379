"""The wiring of a test: what its services produce and consume, and what is required of the application."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

from dodo_dsl.application.model import Declared
from dodo_dsl.diagnostics import Span
from dodo_dsl.opendlv.address import is_of_the_world
from dodo_dsl.spec.arguments import ResolvedService
from dodo_dsl.spec.manifest import Ports

Kind = Literal["message", "memory"]

ANYTHING = "*"

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
        """Whether what is produced at ``other`` is consumed here."""
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
    """A port of a service; ``layer`` is "application" for one of the application's."""

    service: str
    layer: str
    port: Port
    span: Span


@dataclass(frozen=True)
class Wiring:
    """Everything produced and consumed in a test.

    ``undeclared`` names the application's services without x-dodo, ``answers`` and ``done`` are the messages that
    they declare to complete a frame in lockstep, ``printed`` those that are lines of theirs. ``unsent`` are services
    that may send anything by their manifests, and messages that they cannot send.
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

    def producers(self, port: Port) -> list[End]:
        """The test's services that produce what a port consumes."""
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
        """What the test's services consume and none of them produces."""
        return [end for end in self.consumed if not self.producers(end.port)]


def wire(services: Iterable[ResolvedService], declared: Mapping[str, Declared | None] | None) -> Wiring:
    """The wiring of one instance, as far as its arguments fit; ``declared`` is None without an application."""
    produced: list[End] = []
    consumed: list[End] = []
    for service in services:
        use, manifest = service.use, service.manifest
        kinds: tuple[tuple[Kind, Ports], ...] = (("message", service.messages), ("memory", manifest.memory))
        for kind, ports in kinds:
            produced += [End(use.name, use.layer, p, use.span) for p in _ports(kind, ports.outputs, service, 0)]
            consumed += [End(use.name, use.layer, p, use.span) for p in _ports(kind, ports.inputs, service, None)]
    return _with_application(Wiring(tuple(produced), tuple(consumed)), declared)


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


def _with_application(wiring: Wiring, declared: Mapping[str, Declared | None] | None) -> Wiring:
    if declared is None:
        return wiring
    produced: list[End] = []
    consumed: list[End] = []
    answers: list[End] = []
    for service, own in declared.items():
        for ends, names in ((produced, own.outputs), (consumed, own.inputs), (answers, own.answers)) if own else ():
            stamp = 0 if ends is produced else None
            ends += [End(service, "application", message(name, stamp), span) for name, span in names]
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
    )
