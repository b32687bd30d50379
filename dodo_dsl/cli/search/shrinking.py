"""Shrinks the failures of a search by further drives, and writes those that last as tests."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.cli.search.drives import Drives, repeated
from dodo_dsl.search.findings import Failure, Shrunk, kind_of
from dodo_dsl.search.regression import name_of, text_of
from dodo_dsl.search.shrink import changed, nearest, shrink
from dodo_dsl.search.space import Space, texts
from dodo_dsl.search.store import Drive
from dodo_dsl.spec.instances.vary import Values
from dodo_dsl.spec.registry import SUFFIX

_REPEATS = 3
MOST_KINDS = 5
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
        for failure in failures[:MOST_KINDS]:
            self.drives.progress.shrink(failure.worst.reason)
            of_kind = {
                drive.number: (values, drive) for values, drive in failed if kind_of(drive.reason) == failure.kind
            }
            first = nearest(self.space, [drive for _, drive in of_kind.values()])
            values = await self._shrunk(of_kind[first.number][0], failure.kind)
            self.found.append(await self._confirmed(values, failure.kind))
        shutil.rmtree(self.drives.report / FOLDER, ignore_errors=True)

    async def _shrunk(self, values: Values, kind: str) -> Values:
        steps = shrink(self.space, values)
        try:
            asked = next(steps)
            while True:
                await self._drive(asked)
                asked = steps.send([self._fails(one, kind) for one in asked])
        except StopIteration as end:
            shrunk: Values = end.value
            return shrunk

    async def _drive(self, candidates: list[Values], repeat: int = 1) -> None:
        await self.drives.drive(candidates, self.number, repeat)
        self.number += len(candidates)

    def _fails(self, values: Values, kind: str, repeat: int = 1) -> bool:
        drive = self.drives.store.get(repeated(values, repeat))
        return drive is not None and drive.outcome == "failed" and kind_of(drive.reason) == kind

    async def _confirmed(self, values: Values, kind: str) -> Shrunk:
        for repeat in range(2, _REPEATS + 1):
            await self._drive([values], repeat)
        failed = sum(self._fails(values, kind, repeat) for repeat in range(1, _REPEATS + 1))
        drive = self.drives.store.get(texts(values))
        assert drive is not None, "it was driven"
        names = changed(self.space, values)
        spec = self._write(values, names, drive.reason) if failed == _REPEATS else ""
        return Shrunk(kind, drive.reason, texts(values), tuple(names), failed, _REPEATS, spec)

    def _write(self, values: Values, names: Sequence[str], reason: str) -> str:
        """The name of the test that is written."""
        spec = self.drives.spec
        name = name_of(spec, reason, {one.spec for one in self.found})
        text = text_of(spec, name, {one: values[one] for one in names}, reason)
        for folder in filter(None, (self.drives.report / TESTS, self.registry)):
            path = folder / name / f"{name}{SUFFIX}"
            if folder == self.registry and path.exists() and path.read_text() != text:
                self.drives.progress.note(f"'{path}' is kept, as it holds another test")
            else:
                atomic.write_text(path, text)
        return name
