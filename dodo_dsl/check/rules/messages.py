"""``unknown-message``: the messages that parameters and the application name are OpenDLV's or the deployment's."""

from collections.abc import Collection, Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, only_fix
from dodo_dsl.source import MAX_PROBLEMS, Scalar, Sequence


def check(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        for name, entry in service.use.parameters.items():
            argument = service.arguments.get(name)
            if argument and argument.parameter.type == "message" and argument.value:
                yield from _known(context, argument.value.text, entry.value.span)
            if isinstance(entry.value, Sequence) and any(f"{{{name}}}" in p for p in service.manifest.messages.inputs):
                for item in entry.value.items[:MAX_PROBLEMS]:
                    if isinstance(item, Scalar):
                        yield from _known(context, item.text.partition("/")[0], item.span)
    declared = context.application.declared.values() if context.application else ()
    for own in declared:
        for name, span in (*own.inputs, *own.outputs, *own.answers) if own else ():
            yield from _known(context, name.partition("/")[0], span)


def _known(context: RuleContext, name: str, span: Span) -> Iterator[Diagnostic]:
    yield from unknown_message(name, context.messages, span)


def unknown_message(name: str, known: Collection[str], span: Span) -> Iterator[Diagnostic]:
    """The problem of a name that is none of the ``known`` messages."""
    if name and name not in known:
        hint = did_you_mean(name, known) or "add the files of your own messages under 'messages' in dodo.yml"
        fix = only_fix(name, known)
        yield Diagnostic(span, "unknown-message", f"unknown message '{name[:80]}'", hint, fix=fix)
