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
        """What these instances have, sorted by position, each once.

        It names the tests that have it: none if its position shows whose it is, or if it is of a file.
        """
        instances: dict[Path, list[Spec]] = {}
        for spec in specs:
            instances.setdefault(spec.path, []).append(spec)
        names: dict[Diagnostic, dict[str, None]] = {}
        at_home = set[Diagnostic]()
        for path, own in instances.items():
            titles, ends = {spec.title for spec in own}, {e.span for s in own for one in s.ranges for e in one.ends}
            every = titles | {corner.title for spec in own for corner in spec.corners}
            for problem in self.by_rules.get(path, ()):
                having = [title for title in problem.tests if title in every]
                if not having:
                    continue
                is_of_all = titles <= set(having)
                shown = [own[0].name or own[0].location.stem] if is_of_all else having
                names.setdefault(problem, {}).update(dict.fromkeys(shown))
                is_told = (problem.span.file == str(path) and is_of_all) or problem.span in ends
                if is_told or file_rules.is_own(problem):
                    at_home.add(problem)
        read = itertools.chain.from_iterable(found for path, found in self.as_read.items() if path in instances)
        everything = ordered([*self.common, *self.of_services, *read, *names])
        return tuple(replace(d, tests=() if d in at_home else tuple(names.get(d, ()))) for d in everything)


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
