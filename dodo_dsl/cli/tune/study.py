"""What a command line of ``dodo tune`` is about: parameters of the application, and the drives that judge them."""

import argparse
import hashlib
import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from dodo_dsl import compiler
from dodo_dsl.application.tunables import tunables
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.cli import selection
from dodo_dsl.cli.display.colours import write_diagnostics
from dodo_dsl.cli.errors import NO_APPLICATION, UsageError
from dodo_dsl.cli.search.study import digests
from dodo_dsl.compiler import Checked
from dodo_dsl.diagnostics import has_errors, ordered, told_once
from dodo_dsl.emit.render import render_plan
from dodo_dsl.run.runner import default_backend
from dodo_dsl.search.space import Space, space_of, sweep, texts
from dodo_dsl.spec.instances import vary
from dodo_dsl.spec.instances.vary import Values
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.registry import SUFFIX
from dodo_dsl.spec.settings import Settings


@dataclass(frozen=True)
class Scenario:
    """A test at values of its ranges, none for one without ranges."""

    spec: Spec
    values: Values

    @property
    def name(self) -> str:
        return json.dumps([self.spec.slug, texts(self.values)], ensure_ascii=False)


@dataclass(frozen=True)
class TuneStudy:
    """``key`` names what all drives have in common.

    ``scenarios`` guide the tuning, ``deciding`` ones choose among the best of it, and ``held_out`` judge the choice.
    """

    checked: Checked
    space: Space
    scenarios: tuple[Scenario, ...]
    deciding: tuple[Scenario, ...]
    held_out: tuple[Scenario, ...]
    key: str

    @property
    def rigs(self) -> list[str]:
        """Names of the rigs that it drives."""
        return sorted({one.spec.rig for one in self.scenarios if one.spec.rig})


def tune_study(options: argparse.Namespace, work: Path, stdout: TextIO) -> TuneStudy:
    """The study of the options; raises UsageError where the application or a test cannot be tuned."""
    checked = selection.select(options.tests, (), options.application, Settings("lockstep", options.isolation))
    try:
        made = compiler.plan(checked, checked.deployment.root / "nominal") if checked.ok else None
    except compiler.NoApplication:
        raise UsageError(NO_APPLICATION) from None
    problems = ordered([*checked.diagnostics, *(made.problems if made else ())])
    write_diagnostics(stdout, told_once(problems, SUFFIX))
    if made is None or has_errors(problems):
        raise UsageError("the above cannot be compiled")
    space = Space(tunables(checked.application) if checked.application else ())
    _refuse(space, checked.tests, options.samples)
    if default_backend(made.compiled.suite.plans) != "process":
        raise UsageError("tuning starts the application as processes: give each of its services 'x-dodo-process'")
    files = {copy for copies in made.compiled.copies.values() for copy in copies}
    told = [file.text for plan in made.compiled.suite.plans for file in render_plan(plan)]
    told += sorted(f"{file.target} {hashlib.sha256(file.source.read_bytes()).hexdigest()}" for file in files)
    told += [text for n, one in enumerate(checked.specs) if one.ranges for text in digests(checked, one, work / str(n))]
    key = hashlib.sha256(json.dumps(told).encode()).hexdigest()
    return TuneStudy(checked, space, *_scenarios(checked.tests, options.samples, options.seed), key)


def _refuse(space: Space, tests: Sequence[ResolvedTest], samples: int) -> None:
    if not space.ranges:
        raise UsageError("the application has no parameters to tune: write them under 'x-dodo: {tune: ...}'")
    for spec in (test.spec for test in tests):
        if spec.clock != "lockstep" and not spec.rig:
            raise UsageError(f"{spec.title} is in real time and on no rig; tuning needs lockstep or a rig")
        if both := [one.name for one in space.ranges if one.name in spec.variables]:
            raise UsageError(f"{spec.title} sets '{both[0]}' itself, so it cannot be tuned there")
    if samples and not any(test.spec.ranges for test in tests):
        raise UsageError("'--samples' needs a test with ranges, 'vary'")


def _scenarios(
    tests: Sequence[ResolvedTest], samples: int, seed: int
) -> tuple[tuple[Scenario, ...], tuple[Scenario, ...], tuple[Scenario, ...]]:
    """Each test at its nominal values and at samples of its ranges; then as many other samples to decide, and to judge.

    No scenario is in two of them.
    """
    guiding: list[Scenario] = []
    deciding: list[Scenario] = []
    held_out: list[Scenario] = []
    for test in tests:
        points = _points(test, samples, seed)
        guiding += [Scenario(test.spec, vary.nominal(test.spec.ranges)), *_next(test, points, samples)]
        held_out += _next(test, points, samples)
        deciding += _next(test, points, samples)
    used = {one.name: one for one in guiding}
    judging = {one.name: one for one in held_out if one.name not in used}
    others = {one.name: one for one in deciding if one.name not in used and one.name not in judging}
    return tuple(used.values()), tuple(others.values()), tuple(judging.values())


def _next(test: ResolvedTest, points: Iterator[Values], number: int) -> list[Scenario]:
    return [Scenario(test.spec, values) for values in itertools.islice(points, number)]


def _points(test: ResolvedTest, samples: int, seed: int) -> Iterator[Values]:
    return sweep(space_of(test), 3 * samples, seed) if samples and test.spec.ranges else iter(())
