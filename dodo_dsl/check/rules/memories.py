"""``application-memory``: the shared memories that the application asks for are made by services of the test."""

from collections.abc import Iterator

from dodo_dsl import source
from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.access import filled
from dodo_dsl.application.model import ComposeService
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
    asked = {service.name: _asked(service, known) for service in context.application.services.values()}
    for service, names in asked.items():
        others = {name for other, own in asked.items() if other != service for name in own}
        if made.isdisjoint(names) and others.isdisjoint(names):
            for name, span in names.items():
                yield _missing(service, name, span, made)


def _missing(service: str, name: str, span: Span, made: set[str]) -> Diagnostic:
    message = f"the application's '{service}' asks for the memory '{name}', which no service of the test makes"
    near = closest(name, made)
    hint = f"did you mean '{near[0]}'?" if near else f"the test makes {', '.join(sorted(made))}"
    return Diagnostic(span, "application-memory", message, hint, "warning")


def _asked(service: ComposeService, known: dict[str, str]) -> Asked:
    found: Asked = {}
    for key in ("x-dodo-process", "entrypoint", "command"):
        node = service.node.get(key)
        for item in node.items if isinstance(node, source.Sequence) else (node,):
            if isinstance(item, Scalar):
                text = filled.text(item.text, known)
                words = (text,) if isinstance(node, source.Sequence) else _words(text)
                found.update((name, item.span) for name in opendlv_flags.memories(words) if "$" not in name)
    return found


def _words(command: str) -> tuple[str, ...]:
    try:
        return opendlv_flags.split(command)
    except ValueError:
        return ()  # reported with the application
