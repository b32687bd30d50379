"""``no-limit``: an evaluator has something to judge by; ``empty-file``: so has the file that it judges by.

A test that can only pass says nothing about the application.
"""

from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.check.rules.inputs.references import entries
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.arguments import ResolvedService


def check(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        if service.use.layer in service.manifest.layers:
            yield from _limits(service)
            yield from _files(service)


def _limits(service: ResolvedService) -> Iterator[Diagnostic]:
    for names in service.manifest.one_of:
        given = [name for name in names if name in service.use.parameters or service.texts.get(name)]
        if not given:
            message = f"'{service.use.name}' has nothing to judge by"
            yield Diagnostic(
                service.use.span, "no-limit", message, f"write one or more of {', '.join(names)} under 'with'"
            )


def _files(service: ResolvedService) -> Iterator[Diagnostic]:
    for argument in service.arguments.values():
        entry, file = argument.entry, argument.value.path if argument.value else None
        for key in argument.parameter.not_empty if entry and file else ():
            found = entries(file, key) if file else ""
            if isinstance(found, str) and argument.parameter.format:
                continue  # told with the file
            if entry and file and isinstance(found, str):
                yield Diagnostic(entry.value.span, "wrong-file", f"{file.parent.name}/{file.name}: {found}")
            elif entry and file and not found:
                message = f"{file.parent.name}/{file.name} has no {key}, so there is nothing to judge by"
                yield Diagnostic(entry.value.span, "empty-file", message)
