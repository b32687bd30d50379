"""``application-memory``: the shared memories that the application asks for are made by services of the test."""

from collections.abc import Iterator

from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.access import filled
from dodo_dsl.application.model import ComposeService
from dodo_dsl.application.slips import flags
from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, Span, closest
from dodo_dsl.source import Scalar

Asked = dict[str, Span]
"""Memories by name, with where they are written."""


def check(context: RuleContext) -> Iterator[Diagnostic]:
    """A service that reads one memory of the test may make others, and so may services that share one."""
    made = {end.port.name for end in context.wiring.produced if end.port.kind == "memory"}
    if not made or context.application is None or not context.spec.is_whole or not context.test.is_complete:
        return
    set_here = {name: e.value.text for name, e in context.spec.variables.items() if isinstance(e.value, Scalar)}
    known = {**context.application.known, **set_here}
    for service in context.application.services.values():
        yield from _slips(service, known, made)
    asked = {service.name: _asked(service, known) for service in context.application.services.values()}
    for owner, names in asked.items():
        others = {name for other, own in asked.items() if other != owner for name in own}
        if made.isdisjoint(names) and others.isdisjoint(names):
            for name, span in names.items():
                yield _missing(owner, name, span, made)


def _missing(service: str, name: str, span: Span, made: set[str]) -> Diagnostic:
    message = f"the application's '{service}' asks for the memory '{name}', which no service of the test makes"
    near = closest(name, made)
    hint = f"did you mean '{near[0]}'?" if near else f"the test makes {', '.join(sorted(made))}"
    return Diagnostic(span, "application-memory", message, hint, "warning")


def _slips(service: ComposeService, known: dict[str, str], made: set[str]) -> Iterator[Diagnostic]:
    """Flags that are almost ``--name=``, with a memory of the test."""
    for word, item in flags.words(service):
        flag = flags.meant(filled.text(word, known), "--name")
        if flag.partition("=")[2].removeprefix("/") in made:
            message = f"'{word}' of the application's '{service.name}' is not the flag '--name'"
            yield Diagnostic(item.span, "application-memory", message, f"did you mean '{flag}'?", "warning")


def _asked(service: ComposeService, known: dict[str, str]) -> Asked:
    found: Asked = {}
    for word, item in flags.words(service):
        names = opendlv_flags.memories([filled.text(word, known)])
        found.update((name, item.span) for name in names if "$" not in name)
    return found
