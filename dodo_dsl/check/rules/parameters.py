"""Parameters against the manifest: known, complete, of the right type and unit, within bounds, files in place.

``unknown-parameter``, ``missing-parameter``, ``wrong-type``, ``wrong-unit``, ``wrong-value``, ``out-of-range``,
``missing-file``, ``path-escape``.
"""

from collections.abc import Iterator

from dodo_dsl.check.context import Context
from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.spec import arguments
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Use
from dodo_dsl.spec.values import ValueProblem, convert


def check(context: Context) -> Iterator[Diagnostic]:
    for use, manifest in context.known_uses():
        if use.layer not in manifest.layers:
            continue  # it may be another service that is meant
        yield from _written(context, use, manifest)
        yield from _taken(context, use, manifest)
        yield from _missing(context, use, manifest)


def _written(context: Context, use: Use, manifest: Manifest) -> Iterator[Diagnostic]:
    for name, entry in use.parameters.items():
        parameter = manifest.parameters.get(name)
        if parameter is None:
            message = f"service '{manifest.name}' has no parameter '{name}'"
            yield Diagnostic(entry.key, "unknown-parameter", message, did_you_mean(name, manifest.parameters))
            continue
        try:
            convert(parameter, entry.value, context.spec.location.root)
        except ValueProblem as problem:
            yield problem.diagnostic


def _taken(context: Context, use: Use, manifest: Manifest) -> Iterator[Diagnostic]:
    """Values of the rig or of another service that do not fit here."""
    for parameter in manifest.parameters.values():
        if (parameter.rig or parameter.shared) and parameter.name not in use.parameters:
            try:
                arguments.value(context.spec, use, parameter, context.rig)
            except ValueProblem as problem:
                yield problem.diagnostic


def _missing(context: Context, use: Use, manifest: Manifest) -> Iterator[Diagnostic]:
    for parameter in manifest.parameters.values():
        if not parameter.required or parameter.name in use.parameters:
            continue
        if parameter.rig and context.rig and context.rig.entry(parameter.rig):
            continue
        if parameter.shared and not context.spec.is_whole:
            continue  # a service that could not be read may give it
        givers = _givers(context, parameter.name) if parameter.shared else {}
        if len(givers) == 1:
            continue
        message = f"service '{manifest.name}' needs parameter '{parameter.name}': {parameter.help}"
        hint = f"write '{parameter.name}: ...' under 'with'"
        if parameter.rig and context.rig:
            hint += f", or give the rig '{context.rig.name}' its '{parameter.rig}'"
        if len(givers) > 1:
            hint = f"{' and '.join(givers.values())} give different values, so write the one that counts"
        yield Diagnostic(use.span, "missing-parameter", message, hint)


def _givers(context: Context, name: str) -> dict[str, str]:
    """The values that services of the test give to a parameter, each with the first service's name."""
    givers: dict[str, str] = {}
    for use in context.spec.uses:
        if name in use.parameters:
            givers.setdefault(getattr(use.parameters[name].value, "text", ""), use.name)
    return givers
