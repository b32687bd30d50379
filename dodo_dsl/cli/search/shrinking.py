"""Shrinks the failures of a search by further drives, and writes those that last as tests."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.cli.search.drives import Drives, repeated
from dodo_dsl.search.findings import Failure, Shrunk, is_alike, kind_of
from dodo_dsl.search.regression import name_of, text_of
from dodo_dsl.search.shrink import changed, most_drives, nearest, shrink
from dodo_dsl.search.space import Space, texts
from dodo_dsl.search.store import Drive
from dodo_dsl.spec.instances.vary import Values
from dodo_dsl.spec.registry import SUFFIX

_REPEATS = 3
MOST_KINDS, MOST_TRIED = 5, 3
"""Kinds of failures that are shrunk, and drives of a kind that are repeated to find one that fails again."""
FOLDER, TESTS = "shrinking", "failures"


@dataclass
class Shrinker:
    """Numbers its drives from ``number`` on. ``registry`` takes the tests, too, where it is not None."""

    drives: Drives
    space: Space
    number: int
    registry: Path | None = None
    found: list[Shrunk] = field(default_factory=list)

    async def shrink(self, failures: Sequence[Failure], failed: Sequence[tuple[Values, Drive]]) -> None:
        """Shrinks the first failures of ``failed`` drives. Raises Interrupted."""
        self.drives.folder, self.drives.deadline = FOLDER, None
        kinds = [
            {drive.number: (values, drive) for values, drive in failed if kind_of(drive.reason) == failure.kind}
            for failure in failures[:MOST_KINDS]
        ]
        if kinds:
            self.drives.progress.begin_shrinking(len(kinds), sum(map(self._most, kinds)))
        for number, (failure, of_kind) in enumerate(zip(failures, kinds, strict=False), 1):
            self.drives.progress.note(f"shrinking: {failure.worst.reason}")
            await self._shrink(of_kind)
            self.drives.progress.expect(sum(map(self._most, kinds[number:])))
        shutil.rmtree(self.drives.report / FOLDER, ignore_errors=True)

    def _most(self, failed: dict[int, tuple[Values, Drive]]) -> int:
        """Drives that it takes at most to shrink failures of a kind."""
        shrinking = max(most_drives(self.space, values) for values, _ in failed.values())
        return min(MOST_TRIED, len(failed)) + shrinking + _REPEATS - 1

    async def _shrink(self, of_kind: dict[int, tuple[Values, Drive]]) -> None:
        first = await self._first(of_kind)
        if first is None:
            return
        values = await self._shrunk(of_kind[first.number][0], first)
        if texts(values) not in [one.values for one in self.found]:
            self.found.append(await self._confirmed(values))

    async def _first(self, failed: dict[int, tuple[Values, Drive]]) -> Drive | None:
        """The drive nearest to the nominal values that fails again; None where none of the MOST_TRIED nearest does."""
        left = {number: drive for number, (_, drive) in failed.items()}
        for _ in range(min(MOST_TRIED, len(left))):
            drive = nearest(self.space, list(left.values()))
            values = failed[drive.number][0]
            await self._drive([values], 2)
            if self._fails(values, drive, 2):
                return drive
            del left[drive.number]
        return None

    async def _shrunk(self, values: Values, first: Drive) -> Values:
        steps = shrink(self.space, values)
        try:
            asked = next(steps)
            while True:
                await self._drive(asked)
                asked = steps.send([self._fails(one, first) for one in asked])
        except StopIteration as end:
            shrunk: Values = end.value
            return shrunk

    async def _drive(self, candidates: list[Values], repeat: int = 1) -> None:
        await self.drives.drive(candidates, self.number, repeat)
        self.number += len(candidates)

    def _fails(self, values: Values, like: Drive, repeat: int = 1) -> bool:
        drive = self.drives.store.get(repeated(values, repeat))
        return drive is not None and is_alike(like, drive)

    async def _confirmed(self, values: Values) -> Shrunk:
        for repeat in range(2, _REPEATS + 1):
            await self._drive([values], repeat)
        drive = self.drives.store.get(texts(values))
        assert drive is not None, "it was driven"
        failed = sum(self._fails(values, drive, repeat) for repeat in range(1, _REPEATS + 1))
        names = changed(self.space, values)
        spec = self._write(values, names, drive.reason) if failed == _REPEATS else ""
        return Shrunk(kind_of(drive.reason), drive.reason, texts(values), tuple(names), failed, _REPEATS, spec)

    def _write(self, values: Values, names: Sequence[str], reason: str) -> str:
        """The name of the test that is written."""
        spec = self.drives.spec
        name = name_of(spec, names, {one.spec for one in self.found})
        text = text_of(spec, name, {one: values[one] for one in names}, reason)
        for folder in filter(None, (self.drives.report / TESTS, self.registry)):
            path = folder / name / f"{name}{SUFFIX}"
            if folder == self.registry and path.exists() and path.read_text() != text:
                self.drives.progress.note(f"'{path}' is kept, as it holds another test")
            else:
                atomic.write_text(path, text)
        return name
