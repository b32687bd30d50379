"""``unknown-message``: the messages that parameters and the application name are OpenDLV's or the deployment's."""

from collections.abc import Iterator

from dodo_dsl.check.context import Context
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean
from dodo_dsl.source import Entry
from dodo_dsl.spec.manifest import Parameter
from dodo_dsl.spec.values import ValueProblem, convert


def check(context: Context) -> Iterator[Diagnostic]:
    for use, manifest in context.known_uses():
        for name, entry in use.parameters.items():
            parameter = manifest.parameters.get(name)
            if parameter and parameter.type == "message" and _fits(context, parameter, entry):
                yield from _known(context, getattr(entry.value, "text", ""), entry.value.span)
    for declared in (context.declared or {}).values():
        for name, span in (*declared.inputs, *declared.outputs, *declared.answers) if declared else ():
            yield from _known(context, name.partition("/")[0], span)


def _fits(context: Context, parameter: Parameter, entry: Entry) -> bool:
    try:
        convert(parameter, entry.value, context.spec.location.root)
    except ValueProblem:
        return False  # the rule of parameters says so
    return True


def _known(context: Context, name: str, span: Span) -> Iterator[Diagnostic]:
    if name and name not in context.messages:
        hint = did_you_mean(name, context.messages) or "messages of your own: 'messages:' in dodo.yml"
        yield Diagnostic(span, "unknown-message", f"there is no message '{name[:80]}'", hint)
