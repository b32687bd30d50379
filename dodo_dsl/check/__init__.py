"""The rules: each is a module with one question, in one explicit list."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from dodo_dsl.check.context import Context, Declared, Rule
from dodo_dsl.check.rules import layers, levels, messages, names, parameters, references, rigs, services, wiring
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec

RULES: tuple[Rule, ...] = (
    names.check,
    levels.check,
    rigs.check,
    services.check,
    layers.check,
    parameters.check,
    messages.check,
    references.check,
    wiring.check,
)


def check(
    specs: Iterable[Spec],
    manifests: Mapping[str, Manifest],
    deployment: Deployment,
    declared: Mapping[str, Declared | None] | None = None,
) -> list[Diagnostic]:
    """All problems of all instances; ``specs`` are the ones that a name may collide with.

    ``declared`` is what the services of the application say of themselves, None without an application.
    """
    everything = tuple(specs)
    by_name: dict[str, dict[Path, Spec]] = {}
    for spec in everything:
        by_name.setdefault(spec.name or "", {}).setdefault(spec.path, spec)
    named = {name: list(specs.values()) for name, specs in by_name.items()}
    return [
        diagnostic
        for spec in everything
        for rule in RULES
        for diagnostic in rule(Context(spec, manifests, named, deployment, declared))
    ]
