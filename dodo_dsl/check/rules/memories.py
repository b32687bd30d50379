"""``application-memory``: the shared memories that the application asks for are made by services of the test."""

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from dodo_dsl.application import opendlv_flags, slips
from dodo_dsl.application.interpolation import interpolated
from dodo_dsl.application.model import ApplicationSource, ComposeService
from dodo_dsl.check.context import RuleContext
from dodo_dsl.check.replayed import IMAGE, without_pictures
from dodo_dsl.diagnostics import Diagnostic, Span, closest
from dodo_dsl.source import Scalar

Asked = dict[str, Span]
"""Memories by name, with where they are written."""


def check(context: RuleContext) -> Iterator[Diagnostic]:
    """A service that reads one memory of the test may make others, and so may services that share one."""
    ends = [end for end in context.wiring.produced if end.port.kind == "memory"]
    made = {end.port.name for end in ends}
    if not made or context.application is None or not context.spec.is_whole or not context.test.is_complete:
        return
    set_here = {name: e.value.text for name, e in context.spec.variables.items() if isinstance(e.value, Scalar)}
    known = {**context.application.known, **set_here}
    for service in context.application.services.values():
        yield from _slips(service, known, made)
    asked = {service.name: _asked(service, known) for service in context.application.services.values()}
    players = {each.use.name: path for each in context.services if (path := without_pictures(each))}
    shown = {end.port.name for end in ends if end.service not in players}
    yield from _blank(asked, {end.port.name: players[end.service] for end in ends if end.port.name not in shown})
    for owner, names in asked.items():
        others = {name for other, own in asked.items() if other != owner for name in own}
        if made.isdisjoint(names) and others.isdisjoint(names):
            for name, span in names.items():
                yield _missing(owner, name, span, made)


def _blank(asked: Mapping[str, Asked], recordings: Mapping[str, Path]) -> Iterator[Diagnostic]:
    """Memories in which no picture will ever be: their services play recordings without."""
    for service, names in asked.items():
        for name in sorted(names.keys() & recordings.keys()):
            file = recordings[name].name
            message = f"the application's '{service}' reads pictures from '{name}', and '{file}' has none"
            hint = f"take a recording with {IMAGE}; 'dodo rec info' shows what it holds"
            yield Diagnostic(names[name], "application-memory", message, hint, "warning")


def readers(application: ApplicationSource, names: Collection[str]) -> list[str]:
    """The services of an application that ask for one of these memories."""
    services = application.services.values()
    return [each.name for each in services if not set(names).isdisjoint(_asked(each, dict(application.known)))]


def _missing(service: str, name: str, span: Span, made: set[str]) -> Diagnostic:
    message = f"the application's '{service}' asks for the memory '{name}', which no service of the test makes"
    near = closest(name, made)
    hint = f"did you mean '{near[0]}'?" if near else f"the test makes {', '.join(sorted(made))}"
    return Diagnostic(span, "application-memory", message, hint, "warning")


def _slips(service: ComposeService, known: dict[str, str], made: set[str]) -> Iterator[Diagnostic]:
    """Flags that are almost ``--name=``, with a memory of the test."""
    for word, item in slips.words(service):
        flag = slips.meant(interpolated(word, known), "--name")
        if flag.partition("=")[2].removeprefix("/") in made:
            message = f"'{word}' of the application's '{service.name}' is not the flag '--name'"
            yield Diagnostic(item.span, "application-memory", message, f"did you mean '{flag}'?", "warning")


def _asked(service: ComposeService, known: dict[str, str]) -> Asked:
    found: Asked = {}
    for word, item in slips.words(service):
        names = opendlv_flags.memories([interpolated(word, known)])
        found.update((name, item.span) for name in names if "$" not in name)
    return found
