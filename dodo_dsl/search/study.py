"""What drives of a command have in common: its tests, checked and compiled, and the space that they are driven in."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import compiler
from dodo_dsl.application.variables import tunables
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.compiler import Checked, Compilation
from dodo_dsl.emit.render import render_plan
from dodo_dsl.run.runner import default_backend
from dodo_dsl.search.space import Space, space_of
from dodo_dsl.spec import vary
from dodo_dsl.spec.model import Spec


class NotSearchable(Exception):
    """A test or an application that cannot be searched or tuned; one sentence."""

    usage = True


@dataclass(frozen=True)
class Study:
    """``key`` names what all drives have in common: tests with their files, application, ranges, and a search's seed.

    It is the same wherever the repository is.
    """

    checked: Checked
    space: Space
    key: str

    @property
    def test(self) -> ResolvedTest:
        """The one test of a search."""
        return self.checked.tests[0]


def search_study(checked: Checked, made: Compilation, work: Path, seed: int) -> Study:
    """The study of one test, within its ranges."""
    _refuse_containers(made, "a search")
    space = space_of(checked.tests[0])
    ranges = [(one.name, one.text, one.nominal.text, one.is_list) for one in space.ranges]
    return Study(checked, space, _digest([_told(checked, made, work), ranges, sorted(space.whole), seed]))


def refuse_search(word: str, tests: Sequence[ResolvedTest]) -> None:
    """Raises NotSearchable unless the word means one test in lockstep with ranges."""
    if len(tests) != 1:
        names = ", ".join(test.spec.slug for test in tests[:5])
        raise NotSearchable(f"'{word}' means {len(tests)} tests, expected one: {names}")
    spec = tests[0].spec
    if not spec.is_stepped:
        raise NotSearchable(f"{spec.title} runs on hardware, which does not wait; a search needs lockstep")
    if not spec.ranges:
        raise NotSearchable(
            f"{spec.title} has no ranges to search: write them under 'vary', see docs/reference/language.md"
        )


def tune_study(checked: Checked, made: Compilation, work: Path, samples: int) -> Study:
    """The study of an application's parameters in some tests, at ``samples`` of their ranges.

    Raises NotSearchable if the application or a test cannot be tuned.
    """
    space = Space(tunables(checked.application) if checked.application else ())
    _refuse_tuning(space, checked.specs, samples)
    _refuse_containers(made, "tuning")
    return Study(checked, space, _digest(_told(checked, made, work)))


def _refuse_tuning(space: Space, specs: Sequence[Spec], samples: int) -> None:
    if not space.ranges:
        raise NotSearchable("the application has no parameters to tune: write them under 'x-dodo: {tune: ...}'")
    for spec in specs:
        if not spec.is_stepped:
            raise NotSearchable(f"{spec.title} is in real time; tuning needs lockstep")
        if both := [one.name for one in space.ranges if one.name in spec.variables]:
            raise NotSearchable(f"{spec.title} sets '{both[0]}' itself, so it cannot be tuned there")
    if samples and not any(spec.ranges for spec in specs):
        raise NotSearchable("'--samples' needs a test with ranges, 'vary'")


def _refuse_containers(made: Compilation, what: str) -> None:
    if default_backend(made.compiled.suite.plans) != "process":
        raise NotSearchable(f"{what} starts the application as processes: give each of its services 'x-dodo-process'")


def _told(checked: Checked, made: Compilation, work: Path) -> list[str]:
    """The compiled tests, and what their files hold, as maps and recordings, also those at the ends of ranges."""
    told = [file.text for plan in made.compiled.suite.plans for file in render_plan(plan)] + _files(made)
    for number, spec in enumerate(checked.specs):
        nominal = vary.nominal(spec.ranges)
        ends = {str(n): {**nominal, **corner} for n, corner in enumerate(vary.corners(spec.ranges))}
        if spec.ranges:
            told += _files(compiler.plan(compiler.at_values(checked, spec, ends), work / str(number) / "ends"))
    return told


def _files(made: Compilation) -> list[str]:
    files = sorted({copy for copies in made.compiled.copies.values() for copy in copies})
    return [f"{file.target} {hashlib.sha256(file.source.read_bytes()).hexdigest()}" for file in files]


def _digest(told: object) -> str:
    return hashlib.sha256(json.dumps(told).encode()).hexdigest()
