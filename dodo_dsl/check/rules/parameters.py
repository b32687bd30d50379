"""Parameters against the manifest: known, complete, of the right type and unit, within bounds, files in place.

``unknown-parameter``, ``missing-parameter``, ``wrong-type``, ``wrong-unit``, ``wrong-value``, ``out-of-range``,
``missing-file``, ``path-escape``.
"""

from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, did_you_mean, only_fix
from dodo_dsl.source import Entry, Scalar
from dodo_dsl.spec.arguments import ResolvedService
from dodo_dsl.spec.slips import meant, slip_in_key


def check(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        if service.use.layer not in service.manifest.layers:
            continue  # another service may be meant
        yield from _written(service)
        yield from _from_elsewhere(service)
        yield from _missing(context, service)


def _written(service: ResolvedService) -> Iterator[Diagnostic]:
    for name, entry in service.use.parameters.items():
        argument = service.arguments.get(name)
        if argument is None:
            known = service.manifest.parameters
            slip = slip_in_key(name, known, is_empty=_is_empty(entry))
            message = slip.message if slip else f"service '{service.manifest.name}' has no parameter '{name}'"
            hint = slip.hint if slip else did_you_mean(name, known)
            fix = slip.fix if slip else only_fix(name, known, service.use.parameters)
            yield Diagnostic(entry.key, "unknown-parameter", message, hint, fix=fix)
        elif argument.problem:
            yield argument.problem


def _is_empty(entry: Entry) -> bool:
    return isinstance(entry.value, Scalar) and entry.value.value is None


def _misspelt(service: ResolvedService) -> set[str]:
    """The parameters that unknown ones most likely mean, which are not missing as well."""
    known = service.manifest.parameters
    unknown = ((name, entry) for name, entry in service.use.parameters.items() if name not in known)
    return {meant(name, known, is_empty=_is_empty(entry)) for name, entry in unknown}


def _from_elsewhere(service: ResolvedService) -> Iterator[Diagnostic]:
    """Values of the rig or of another service that do not fit here."""
    for name, argument in service.arguments.items():
        if argument.problem and name not in service.use.parameters:
            yield argument.problem


def _missing(context: RuleContext, service: ResolvedService) -> Iterator[Diagnostic]:
    use, manifest, misspelt = service.use, service.manifest, _misspelt(service)
    for parameter in manifest.parameters.values():
        if not parameter.required or parameter.name in use.parameters or parameter.name in misspelt:
            continue
        if parameter.rig and (context.rig.entry(parameter.rig) if context.rig else _wants_rig(context)):
            continue  # a rig that is unknown or missing may give it, too
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
            hint = f"{' and '.join(givers.values())} give different values, so write the one to use"
        yield Diagnostic(use.span, "missing-parameter", message, hint)


def _wants_rig(context: RuleContext) -> bool:
    return bool(context.spec.rig) or context.spec.level == "hil"


def _givers(context: RuleContext, name: str) -> dict[str, str]:
    """The values that services of the test give to a parameter, each with the first service's name."""
    givers: dict[str, str] = {}
    for use in context.spec.uses:
        if name in use.parameters:
            givers.setdefault(getattr(use.parameters[name].value, "text", ""), use.name)
    return givers
