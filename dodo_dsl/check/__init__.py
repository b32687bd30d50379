"""The rules: each is a module with one question, in one explicit list."""

from collections.abc import Iterable, Mapping

from dodo_dsl.check.context import Context, Rule
from dodo_dsl.check.rules import layers, levels, names, parameters, services
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec

RULES: tuple[Rule, ...] = (
    names.check,
    levels.check,
    services.check,
    layers.check,
    parameters.check,
)


def check(specs: Iterable[Spec], manifests: Mapping[str, Manifest]) -> list[Diagnostic]:
    """All problems of all specs; ``specs`` are the ones that a name may collide with."""
    everything = tuple(specs)
    by_name: dict[str, list[Spec]] = {}
    for spec in everything:
        by_name.setdefault(spec.name or "", []).append(spec)
    return [
        diagnostic for spec in everything for rule in RULES for diagnostic in rule(Context(spec, manifests, by_name))
    ]
