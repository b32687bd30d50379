"""The wiring of a test: which service says what, who hears it, and what is left to the application."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from dodo_dsl.check.context import Context, Declared
from dodo_dsl.diagnostics import Span
from dodo_dsl.spec import arguments
from dodo_dsl.spec.manifest import Ports

Kind = Literal["message", "memory"]

ANYTHING = "*"
NOT_OF_THE_APPLICATION = ("opendlv.sim.", "dodo.")
"""Packages of messages that only a simulation sends: no application has them to give."""

_PARAMETER = re.compile(r"\{(?P<name>[^{}]+)\}")
_STAMP = re.compile(r"[0-9]{1,10}")


@dataclass(frozen=True)
class Port:
    """What is said or heard. ``stamp`` is a message's sender stamp, None hears any; ``optional`` may stay silent."""

    kind: Kind
    name: str
    stamp: int | None = None
    optional: bool = False

    def __str__(self) -> str:
        return self.name if self.stamp is None else f"{self.name}/{self.stamp}"

    def hears(self, other: "Port") -> bool:
        """Whether what ``other`` says is heard here."""
        if other.name == ANYTHING:
            return True
        same = (self.kind, self.name) == (other.kind, other.name)
        return same and (self.stamp is None or other.stamp is None or self.stamp == other.stamp)

    @property
    def may_be_asked(self) -> bool:
        """Whether an application could give it."""
        return self.kind == "memory" or not self.name.startswith(NOT_OF_THE_APPLICATION)


@dataclass(frozen=True)
class End:
    """A port of a service; ``layer`` is "application" for one of the application's."""

    service: str
    layer: str
    port: Port
    span: Span


@dataclass(frozen=True)
class Wiring:
    """Everything said and heard in a test. ``undeclared`` names application services that say nothing of theirs."""

    said: tuple[End, ...]
    heard: tuple[End, ...]
    application_says: tuple[End, ...] = ()
    application_hears: tuple[End, ...] = ()
    undeclared: tuple[str, ...] = ()
    has_application: bool = False
    answers: tuple[End, ...] = ()
    done: str = ""

    def producers(self, port: Port) -> list[End]:
        """Services of the test that say what a port hears."""
        return [end for end in self.said if port.hears(end.port)]

    def application_may_say(self, port: Port) -> bool:
        """Whether the application says it, or could as it does not say what it says."""
        if not port.may_be_asked:
            return False
        open_ended = not self.has_application or bool(self.undeclared) or port.kind == "memory"
        return open_ended or any(port.hears(end.port) for end in self.application_says)

    def asked(self) -> list[End]:
        """What the test's services hear and nobody in the test says."""
        return [end for end in self.heard if not self.producers(end.port)]


def wire(context: Context) -> Wiring:
    """The wiring of one instance, as far as its parameters can be read."""
    said: list[End] = []
    heard: list[End] = []
    spec = context.spec
    for use, manifest in context.known_uses():
        values = arguments.texts(spec, use, manifest, context.rig)
        kinds: tuple[tuple[Kind, Ports], ...] = (("message", manifest.messages), ("memory", manifest.memory))
        for kind, ports in kinds:
            said += [End(use.name, use.layer, p, use.span) for p in _ports(kind, ports.outputs, values, 0)]
            heard += [End(use.name, use.layer, p, use.span) for p in _ports(kind, ports.inputs, values, None)]
    return _with_application(Wiring(tuple(said), tuple(heard)), context.declared)


def _ports(kind: Kind, written: Sequence[str], values: Mapping[str, str], stamp: int | None) -> Iterator[Port]:
    for text in written:
        names = {m["name"] for m in _PARAMETER.finditer(text)}
        if not names <= values.keys():
            continue  # an optional parameter that was not given: no such port
        optional = text.endswith("?")
        filled = _PARAMETER.sub(lambda m: values[m["name"]], text.removesuffix("?"))
        if kind == "memory":
            yield Port(kind, filled.removeprefix("/"), None, optional)
        elif filled:
            yield message(filled, stamp, optional)


def message(text: str, stamp: int | None, optional: bool = False) -> Port:
    """The port of ``name`` or ``name/senderStamp``; ``stamp`` is what a name alone means."""
    name, _, number = text.partition("/")
    return Port("message", name, int(number) if _STAMP.fullmatch(number) else stamp, optional)


def _with_application(wiring: Wiring, declared: Mapping[str, Declared | None] | None) -> Wiring:
    if declared is None:
        return wiring
    says: list[End] = []
    hears: list[End] = []
    answers: list[End] = []
    for service, own in declared.items():
        for ends, names in ((says, own.outputs), (hears, own.inputs), (answers, own.answers)) if own else ():
            stamp = 0 if ends is says else None
            ends += [End(service, "application", message(name, stamp), span) for name, span in names]
    ending = [own.done[0] for own in declared.values() if own and own.done]
    return replace(
        wiring,
        done=ending[0] if ending else "",
        application_says=tuple(says),
        application_hears=tuple(hears),
        answers=tuple(answers),
        undeclared=tuple(s for s, own in declared.items() if own is None),
        has_application=True,
    )
