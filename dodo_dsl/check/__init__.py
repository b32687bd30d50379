"""The rules: each is a module with one concern, in one explicit list."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.check import file_rules, resolve, service_rules, spec_rules, wiring_rules
from dodo_dsl.check.resolve import ResolvedTest, Rule, RuleContext
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec

RULES: tuple[Rule, ...] = (
    spec_rules.check_names,
    spec_rules.check_levels,
    spec_rules.check_clock_rates,
    spec_rules.check_rigs,
    spec_rules.check_built_in_cid,
    service_rules.check_cameras,
    service_rules.check_services,
    service_rules.check_parameters,
    service_rules.check_messages,
    service_rules.check_own_messages,
    file_rules.check_references,
    file_rules.check_files,
    file_rules.check_limits,
    file_rules.check_input,
    spec_rules.check_until,
    spec_rules.check_goals,
    wiring_rules.check_producers,
    wiring_rules.check_topics,
    wiring_rules.check_hidden_messages,
    wiring_rules.check_variables,
    wiring_rules.check_memories,
)


def check(
    tests: Iterable[ResolvedTest],
    manifests: Mapping[str, Manifest],
    deployment: Deployment,
    application: ApplicationSource | None = None,
    corners: Iterable[ResolvedTest] = (),
) -> dict[Path, list[Diagnostic]]:
    """All problems of all instances, by spec, each once and with all instances that have it.

    ``corners`` are instances at the ends of their ranges, whose problems are added to those of the others, each with
    the first that has it.
    """
    everything = tuple(tests)
    by_name: dict[str, dict[Path, Spec]] = {}
    for test in everything:
        by_name.setdefault(test.spec.name or "", {}).setdefault(test.spec.path, test.spec)
    named = {name: list(specs.values()) for name, specs in by_name.items()}

    def problems(test: ResolvedTest) -> dict[Diagnostic, None]:
        context = RuleContext(test, manifests, named, deployment, application)
        return dict.fromkeys(diagnostic for rule in RULES for diagnostic in rule(context))

    having: dict[Path, dict[Diagnostic, list[str]]] = {test.spec.path: {} for test in everything}
    for test in everything:
        for diagnostic in problems(test):
            having[test.spec.path].setdefault(diagnostic, []).append(test.spec.title)
    for corner in corners:
        for diagnostic in problems(corner):
            having[corner.spec.path].setdefault(diagnostic, [corner.spec.title])
    return {path: [replace(d, tests=tuple(titles)) for d, titles in found.items()] for path, found in having.items()}


def forget_files() -> None:
    """What is kept of the files that tests name, which may have changed."""
    for kept in (*vars(file_rules).values(), *vars(resolve).values()):
        if hasattr(kept, "cache_clear"):
            kept.cache_clear()
