"""Shrinks the failures of a search by further drives, and writes those that last as tests.

As few values as possible stay away from nominal, and these are as near to it as possible. After A. Zeller and R.
Hildebrandt, Simplifying and Isolating Failure-Inducing Input, 2002, with a search for the limit of each value left.
"""

import json
import os
import re
import shutil
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.search.drives import Drives, drive_name, point_at
from dodo_dsl.search.findings import SearchFailure, Shrunk, is_alike, kind_of
from dodo_dsl.search.space import Space, nominal, scalar, step_of, texts
from dodo_dsl.search.store import Drive
from dodo_dsl.search.study import Study
from dodo_dsl.source import Scalar
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.registry import SUFFIX
from dodo_dsl.spec.vary import Range, Values

_REPEATS = 3
MOST_KINDS, MOST_TRIED = 5, 3
"""Kinds of failures that are reduced, and drives of a kind that are repeated to find one that fails again."""
FOLDER, TESTS = "shrinking", "failures"
_PARTS = 4
_ROUNDS = 6
"""Rounds in each of which a way becomes a quarter: less than a thousandth is left."""
_NOT_WORD = re.compile(r"[^a-z0-9]+")
_MOST_NAME, _MOST_OF_TEST = 57, 40
"""Characters of a name, of which the schema allows 60, before its number, and of those of the test's in it."""

Fails = Callable[[list[Values]], Awaitable[list[bool]]]
"""Which of some values fail for the same reason."""


@dataclass
class Shrinker:
    """Numbers its drives from ``number`` on. ``report`` takes the tests, as does ``registry`` if there is one."""

    study: Study
    drives: Drives
    report: Path
    number: int
    registry: Path | None = None
    found: list[Shrunk] = field(default_factory=list)

    async def shrink(self, failures: Sequence[SearchFailure], failed: Sequence[tuple[Values, Drive]]) -> None:
        """Shrinks the first failures of ``failed`` drives, however long it takes. Raises Interrupted."""
        self.drives.folder = self.report / FOLDER
        for failure in failures[:MOST_KINDS]:
            self.drives.progress.note(f"reducing: {failure.worst.reason}")
            await self._shrink([one for one in failed if kind_of(one[1].reason) == failure.kind])
        shutil.rmtree(self.report / FOLDER, ignore_errors=True)

    async def _shrink(self, of_kind: Sequence[tuple[Values, Drive]]) -> None:
        """The failure nearest to the nominal values that fails again, of the MOST_TRIED nearest."""
        for values, drive in sorted(of_kind, key=lambda one: distance(self.study.space, one[0]))[:MOST_TRIED]:
            await self._drive([values], 2)
            if self._fails(values, drive, 2):

                async def fails(asked: list[Values], like: Drive = drive) -> list[bool]:
                    await self._drive(asked)
                    return [self._fails(one, like) for one in asked]

                shrunk = await shrink(self.study.space, values, fails)
                if texts(shrunk) not in [one.values for one in self.found]:
                    self.found.append(await self._confirmed(shrunk))
                return

    async def _drive(self, candidates: list[Values], repeat: int = 1) -> None:
        points = [point_at(self.study.test.spec, values, repeat) for values in candidates]
        await self.drives.drive(points, self.number)
        self.number += len(candidates)

    def _fails(self, values: Values, like: Drive, repeat: int = 1) -> bool:
        drive = self.drives.store.get(drive_name(values, repeat))
        return drive is not None and is_alike(like, drive)

    async def _confirmed(self, values: Values) -> Shrunk:
        for repeat in range(2, _REPEATS + 1):
            await self._drive([values], repeat)
        drive = self.drives.store.get(drive_name(values))
        assert drive is not None, "it was driven"
        failed = sum(self._fails(values, drive, repeat) for repeat in range(1, _REPEATS + 1))
        names = changed(self.study.space, values)
        spec = self._write(values, names, drive.reason) if failed == _REPEATS else ""
        return Shrunk(kind_of(drive.reason), drive.reason, texts(values), tuple(names), failed, _REPEATS, spec)

    def _write(self, values: Values, names: Sequence[str], reason: str) -> str:
        """The name of the test that is written."""
        spec = self.study.test.spec
        name = name_of(spec, names, {one.spec for one in self.found})
        text = text_of(spec, name, {one: values[one] for one in names}, reason)
        for folder in filter(None, (self.report / TESTS, self.registry)):
            path = folder / name / f"{name}{SUFFIX}"
            if folder == self.registry and path.exists() and path.read_text() != text:
                self.drives.progress.note(f"'{path}' is kept, because it holds another test")
            else:
                atomic.write_text(path, text)
        return name


def distance(space: Space, values: Values) -> float:
    """From the nominal values, in shares of the ranges."""
    return sum(_away(one, values[one.name].text) for one in space.ranges)


def _away(one: Range, text: str) -> float:
    if one.is_list:
        return float(text != one.nominal.text)
    low, middle, number, high = map(one.number, (one.ends[0].text, one.nominal.text, text, one.ends[1].text))
    return float(abs(number - middle) / (high - low))


def changed(space: Space, values: Values) -> list[str]:
    """The ranges whose values are not nominal."""
    return [one.name for one in space.ranges if values[one.name].text != one.nominal.text]


async def shrink(space: Space, values: Values, fails: Fails) -> Values:
    """Values that fail, from others that do."""
    values = await _fewer(space, values, fails)
    for one in space.ranges:
        if not one.is_list and one.name in changed(space, values):
            values = await _nearer(space, values, one, fails)
    return values


async def _fewer(space: Space, values: Values, fails: Fails) -> Values:
    """Puts values back to nominal, one after the other, until none of them can be."""
    plain = nominal(space)
    while names := changed(space, values):
        single = [values | {name: plain[name]} for name in names]
        free = [name for name, still in zip(names, await fails(single), strict=True) if still]
        if not free:
            return values
        more = [values | {name: plain[name] for name in free[: n + 1]} for n in range(len(free))]
        values = [more[0], *(one for one, still in zip(more, await fails(more), strict=True) if still)][-1]
    return values


async def _nearer(space: Space, values: Values, one: Range, fails: Fails) -> Values:
    """Moves a number towards its nominal value, as far as it still fails."""
    passes, fails_at = one.number(one.nominal.text), one.number(values[one.name].text)
    step = Decimal(1) if one.name in space.whole else step_of(one)
    for _ in range(_ROUNDS):
        parts = [passes + (fails_at - passes) * n / _PARTS for n in range(1, _PARTS)]
        rounded = dict.fromkeys((part / step).to_integral_value() * step for part in parts)
        between = [number for number in rounded if min(passes, fails_at) < number < max(passes, fails_at)]
        if not between:
            break
        tried = [values | {one.name: scalar(one, number)} for number in between]
        first = next((n for n, still in enumerate(await fails(tried)) if still), None)
        if first is None:
            passes = between[-1]
            continue
        values, fails_at = tried[first], between[first]
        passes = between[first - 1] if first else passes
    return values


def name_of(spec: Spec, changed: Sequence[str], taken: set[str]) -> str:
    """A name that is not ``taken``: the test's and the ranges whose values are not nominal."""
    words = "-".join(word for name in changed for word in _NOT_WORD.split(name.lower()) if word) or "nominal"
    name = f"{spec.location.stem[:_MOST_OF_TEST].rstrip('-')}-fails-at-{words}"[:_MOST_NAME].rstrip("-")
    numbered = (f"{name}-{number}" for number in range(2, len(taken) + 2))
    return next(one for one in (name, *numbered) if one not in taken)


def text_of(spec: Spec, name: str, values: Values, reason: str) -> str:
    """The file ``NAME/NAME.dodo.yml`` of the test's registry, where ``values`` are those that are not nominal."""
    base = os.path.relpath(spec.location.path, spec.location.root / name)
    lines = [
        "dodo: 1",
        f"name: {name}",
        f"extends: {_quoted(base)}",
        f"description: {_quoted(f'Found by dodo search: {reason}')}",
        f"clock: {spec.clock if spec.is_stepped else 'lockstep'}",
    ]
    if spec.choice.values:
        chosen = ", ".join(f"{key}: [{_written(value)}]" for key, value in spec.choice.values)
        lines.append(f"matrix: {{{chosen}}}")
    if values:
        lines.append("vary:")
        lines += [f"  {key}: {{nominal: {_written(value)}}}" for key, value in values.items()]
    return "\n".join(lines) + "\n"


def _written(value: Scalar) -> str:
    return _quoted(value.text) if isinstance(value.value, str) else value.text


def _quoted(text: str) -> str:
    """A string of JSON, which is one of YAML too."""
    return json.dumps(text, ensure_ascii=False)
