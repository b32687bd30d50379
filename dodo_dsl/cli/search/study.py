"""What a command line of ``dodo search`` is about: one test with ranges, checked and compiled."""

import argparse
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from dodo_dsl import compiler
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.cli import selection
from dodo_dsl.cli.display.colours import write_diagnostics
from dodo_dsl.cli.errors import NO_APPLICATION, UsageError
from dodo_dsl.compiler import Checked
from dodo_dsl.diagnostics import has_errors, ordered
from dodo_dsl.emit.render import render_plan
from dodo_dsl.run.runner import default_backend
from dodo_dsl.search.space import Space, space_of
from dodo_dsl.spec.instances import vary
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.settings import Settings


@dataclass(frozen=True)
class Study:
    """``key`` names what all drives of a search have in common: test with its files, application, ranges and seed.

    It is the same wherever the repository is.
    """

    checked: Checked
    test: ResolvedTest
    space: Space
    key: str


def study_of(options: argparse.Namespace, work: Path, stdout: TextIO) -> Study:
    """The study of the options; raises UsageError where the test cannot be searched."""
    checked = selection.select([options.test], (), options.application, Settings("lockstep", options.isolation))
    tests = checked.tests
    if checked.ok:
        refuse(options.test, tests)
    try:
        made = compiler.plan(checked, checked.deployment.root / "nominal") if checked.ok else None
    except compiler.NoApplication:
        raise UsageError(NO_APPLICATION) from None
    problems = ordered([*checked.diagnostics, *(made.problems if made else ())])
    write_diagnostics(stdout, problems)
    if made is None or has_errors(problems):
        raise UsageError("the test above cannot be compiled")
    (plan,) = made.compiled.suite.plans
    if default_backend([plan]) != "process":
        raise UsageError("a search starts the application as processes: give each of its services 'x-dodo-process'")
    space = space_of(tests[0])
    texts = [file.text for file in render_plan(plan)]
    texts += digests(checked, tests[0].spec, work)
    return Study(checked, tests[0], space, _key(texts, space, options.seed))


def digests(checked: Checked, spec: Spec, work: Path) -> list[str]:
    """What the files of the test hold, as maps and recordings, also those at the ends of its ranges."""
    nominal = vary.nominal(spec.ranges)
    ends = {str(n): {**nominal, **corner} for n, corner in enumerate(vary.corners(spec.ranges))}
    made = compiler.plan(compiler.at_values(checked, spec, ends), work / "ends")
    files = sorted({copy for copies in made.compiled.copies.values() for copy in copies})
    return [f"{file.target} {hashlib.sha256(file.source.read_bytes()).hexdigest()}" for file in files]


def refuse(word: str, tests: tuple[ResolvedTest, ...]) -> None:
    """Raises UsageError unless the word means one test in lockstep with ranges."""
    if len(tests) != 1:
        names = ", ".join(test.spec.slug for test in tests[:5])
        raise UsageError(f"'{word}' means {len(tests)} tests, expected one: {names}")
    spec = tests[0].spec
    if spec.clock != "lockstep":
        raise UsageError(f"{spec.title} runs on hardware, which does not wait; a search needs lockstep")
    if not spec.ranges:
        raise UsageError(
            f"{spec.title} has no ranges to search: write them under 'vary', see docs/reference/language.md"
        )


def _key(texts: list[str], space: Space, seed: int) -> str:
    ranges = [(one.name, one.text, one.nominal.text, one.is_list) for one in space.ranges]
    return hashlib.sha256(json.dumps([texts, ranges, sorted(space.whole), seed]).encode()).hexdigest()
