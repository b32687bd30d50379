"""What is wrong with a deployment, its services and each test, and what of it a selection of tests has.

``unknown-message`` in manifests of own services: each message that a service reads or sends is known.
"""

import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.check import file_rules
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.check.service_rules import unknown_message
from dodo_dsl.diagnostics import Diagnostic, ordered
from dodo_dsl.source import Reader, Scalar, walk
from dodo_dsl.spec.model import Spec

_OF_ALL = "name-taken"
"""A service that has the name of another is not known, so that no test uses it."""


@dataclass(frozen=True)
class Problems:
    """Everything that was found: with the deployment and its application, its services, each spec as it was read.

    ``by_rules`` are those of each spec's instances, which the ``tests`` of a problem name, all of them.
    """

    common: tuple[Diagnostic, ...] = ()
    of_services: tuple[Diagnostic, ...] = ()
    as_read: Mapping[Path, Sequence[Diagnostic]] = field(default_factory=dict)
    by_rules: Mapping[Path, Sequence[Diagnostic]] = field(default_factory=dict)

    def without_unused(self, tests: Sequence[ResolvedTest]) -> "Problems":
        """The same without those of services that no test uses; all stay where a test uses one that cannot be read."""
        if not all(test.is_complete for test in tests):
            return self
        used = {service.manifest.folder.resolve() for test in tests for service in test.services}
        kept = (d for d in self.of_services if d.rule == _OF_ALL or Path(d.span.file).resolve().parent in used)
        return replace(self, of_services=tuple(kept))

    def of(self, specs: Iterable[Spec]) -> tuple[Diagnostic, ...]:
        """What these instances have, sorted by position, each once and with the tests that it depends on."""
        instances: dict[Path, list[Spec]] = {}
        for spec in specs:
            instances.setdefault(spec.path, []).append(spec)
        by_rules = {path: list(_of(own, self.by_rules.get(path, ()))) for path, own in instances.items()}
        read = itertools.chain.from_iterable(own for path, own in self.as_read.items() if path in instances)
        ruled = dict.fromkeys(itertools.chain.from_iterable(by_rules.values()))
        having = _having(instances, by_rules)
        found = ordered([*self.common, *self.of_services, *read, *ruled])
        return tuple(replace(d, tests=having.get(d, ())) for d in found)


def _of(instances: Sequence[Spec], found: Sequence[Diagnostic]) -> Iterator[Diagnostic]:
    """The problems that some of a file's instances have, or that they have at an end of their ranges."""
    titles = {one.title for spec in instances for one in (spec, *spec.corners)}
    for problem in found:
        if tests := tuple(title for title in problem.tests if title in titles):
            yield replace(problem, tests=tests)


def _having(
    instances: Mapping[Path, Sequence[Spec]], by_rules: Mapping[Path, Sequence[Diagnostic]]
) -> Mapping[Diagnostic, tuple[str, ...]]:
    """The tests named with each problem: none if its position shows whose it is, or if it is of a file."""
    names: dict[Diagnostic, list[str]] = {}
    at_home = set[Diagnostic]()
    for path, found in by_rules.items():
        own = instances[path]
        titles = {spec.title for spec in own}
        name = own[0].name or own[0].location.stem
        ends = {end.span for spec in own for one in spec.ranges for end in one.ends}
        for problem in found:
            is_of_all = titles <= set(problem.tests)
            is_told = (problem.span.file == str(path) and is_of_all) or problem.span in ends
            if is_told or file_rules.is_own(problem):
                at_home.add(problem)
            names.setdefault(problem, []).extend([name] if is_of_all else problem.tests)
    return {problem: tuple(dict.fromkeys(those)) for problem, those in names.items() if problem not in at_home}


_NAME = re.compile(r"[\w.]+")


def problems(folders: tuple[Path, ...], reader: Reader, known: Collection[str]) -> Iterator[Diagnostic]:
    """The messages that are not ``known`` in ``<folder>/<service>/service.yml``; a placeholder is for the test to name.

    Loading these files reports whatever else is wrong with them.
    """
    for folder in folders:
        for path in sorted(folder.glob("*/service.yml")):
            node, _ = reader(path)
            ports = node.get("messages") if isinstance(node, source.Mapping) else None
            for scalar in walk(ports) if ports is not None else ():
                name = scalar.text.partition("/")[0].removesuffix("?") if isinstance(scalar, Scalar) else ""
                if _NAME.fullmatch(name):
                    yield from unknown_message(name, known, scalar.span)
