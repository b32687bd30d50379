"""Checks again only what a change can affect, for editors that check after every keystroke."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.check import check
from dodo_dsl.check.resolve import ResolvedTest, resolve
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.deployment.deployment import Deployment
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec


@dataclass(frozen=True)
class Surroundings:
    """What every test is checked with."""

    manifests: Mapping[str, Manifest]
    deployment: Deployment
    application: ApplicationSource | None


@dataclass(frozen=True)
class Findings:
    """The tests of a check, and what the rules found, by spec."""

    around: Surroundings
    tests: tuple[ResolvedTest, ...]
    by_rules: Mapping[Path, Sequence[Diagnostic]]


def check_again(
    specs: Sequence[Spec], corners: Sequence[Spec], around: Surroundings, former: Findings | None = None
) -> Findings:
    """Resolves and checks the instances, and those at the ends of their ranges.

    Those that are the very objects of the former check keep what it found. A test is checked again, too, where another
    one took or gave up its name.
    """
    known = {id(test.spec): test for test in former.tests} if former and former.around == around else {}
    is_new = [spec for spec in specs if id(spec) not in known]
    paths = {spec.path for spec in is_new}
    fresh = {id(test.spec): test for test in resolve((s for s in specs if s.path in paths), *_parts(around))}
    tests = tuple(fresh.get(id(spec)) or known[id(spec)] for spec in specs)
    here = {id(spec) for spec in specs}
    gone = [test.spec for key, test in known.items() if key not in here]
    names = {spec.name for spec in (*is_new, *gone)}
    affected = {spec.path for spec in specs if spec.name in names} | paths | {spec.path for spec in gone}
    at_ends = resolve((corner for corner in corners if corner.path in affected), *_parts(around))
    found: dict[Path, Sequence[Diagnostic]] = {}
    checked = check(tests, *_parts(around), at_ends, affected)
    for spec in specs:
        found[spec.path] = checked[spec.path] if former is None or spec.path in affected else former.by_rules[spec.path]
    return Findings(around, tests, found)


def _parts(around: Surroundings) -> tuple[Mapping[str, Manifest], Deployment, ApplicationSource | None]:
    return around.manifests, around.deployment, around.application
