"""The rules: each is a module with one question, in one explicit list."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from dodo_dsl.check.context import Context, Declared, Rule
from dodo_dsl.check.rules import (
    clocks,
    layers,
    levels,
    messages,
    names,
    parameters,
    producers,
    references,
    rigs,
    services,
)
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec

RULES: tuple[Rule, ...] = (
    names.check,
    levels.check,
    clocks.check,
    rigs.check,
    services.check,
    layers.check,
    parameters.check,
    messages.check,
    references.check,
    producers.check,
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
    instances: dict[Path, list[tuple[Spec, list[Diagnostic]]]] = {}
    for spec in everything:
        context = Context(spec, manifests, named, deployment, declared)
        instances.setdefault(spec.path, []).append((spec, [d for rule in RULES for d in rule(context)]))
    return [diagnostic for group in instances.values() for diagnostic in _with_instances(group)]


def _with_instances(group: Sequence[tuple[Spec, list[Diagnostic]]]) -> Iterator[Diagnostic]:
    """The problems of a file's instances, each once; those that only some have say which."""
    having: dict[Diagnostic, dict[str, None]] = {}
    for spec, found in group:
        for diagnostic in found:
            having.setdefault(diagnostic, {})[spec.title] = None
    for diagnostic, titles in having.items():
        if len(titles) == len(group):
            yield diagnostic
        else:
            others = f" and {len(titles) - 1} more" if len(titles) > 1 else ""
            yield replace(diagnostic, message=f"{diagnostic.message} (in {next(iter(titles))}{others})")
