"""A search: the nominal values and a course of drives, until all are done, time is over, or a failure ends it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from dodo_dsl.search.drives import Drives, drive_name, point_at
from dodo_dsl.search.findings import Findings, find, is_alike
from dodo_dsl.search.space import Candidate, Space, course, nominal, texts
from dodo_dsl.search.store import Drive
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.vary import Values

_TOGETHER = 8
"""Drives among which a failure is looked for at once where it ends the search."""


@dataclass
class SearchLoop:
    """``done`` are the candidates that were driven, in their order, without the nominal values.

    ``until_failure`` is whether it ends after the few drives of which one has failed, and fails again. A drive that
    failed and did not when it was repeated has no outcome: its application may have got no processor.
    """

    spec: Spec
    space: Space
    runs: int
    seed: int
    drives: Drives
    corners: bool = True
    until_failure: bool = False
    done: list[Candidate] = field(default_factory=list)

    async def follow(self) -> None:
        """Drives as far as time suffices. Raises Interrupted."""
        await self._drive([nominal(self.space)], 0)
        candidates = list(course(self.space, self.runs, self.seed, self.corners))
        size = _TOGETHER if self.until_failure else len(candidates)
        for begin in range(0, len(candidates), size):
            batch = candidates[begin : begin + size]
            try:
                await self._drive([one.values for one in batch], begin + 1)
                if self.until_failure:
                    await self._repeat_failures(batch, begin + 1)
            finally:
                self.done += [one for one in batch if self.drives.store.get(drive_name(one.values))]
            if self.ended_early or self.drives.is_over:
                return

    async def _drive(self, candidates: Sequence[Values], first: int, repeat: int = 1) -> None:
        await self.drives.drive([point_at(self.spec, values, repeat) for values in candidates], first)

    @property
    def ended_early(self) -> bool:
        """Whether a failure ended it."""
        return self.until_failure and bool(self.failed())

    async def _repeat_failures(self, batch: Sequence[Candidate], first: int) -> None:
        for number, one in enumerate(batch, first):
            if (drive := self._known(one.values)) and drive.outcome == "failed":
                await self._drive([one.values], number, 2)

    def _known(self, values: Values) -> Drive | None:
        """The drive at some values, in error where it failed once and not again."""
        drive = self.drives.store.get(drive_name(values))
        if drive is None or drive.outcome != "failed":
            return drive
        again = self.drives.store.get(drive_name(values, 2))
        if again is None or is_alike(drive, again):
            return drive
        return replace(drive, outcome="error", margin=None, reason=f"failed once and not again: {drive.reason}")

    def failed(self) -> list[tuple[Values, Drive]]:
        """The drives that failed, with their values."""
        drives = ((one.values, self._known(one.values)) for one in self.done)
        return [(values, drive) for values, drive in drives if drive and drive.outcome == "failed"]

    def findings(self) -> Findings:
        """What the drives say."""
        at_nominal = self.drives.store.get(drive_name(nominal(self.space)))
        swept, others = ([*self._of(is_swept)] for is_swept in (True, False))
        found = find(self.spec.title, self.seed, self.space, at_nominal, swept, others)
        return replace(found, ended_early=self.ended_early)

    def _of(self, swept: bool) -> Iterator[Drive]:
        """The drives of the sweep, or those at the ends, each of their values once."""
        chosen = {tuple(texts(one.values).values()): one.values for one in self.done if one.swept is swept}
        for values in chosen.values():
            if drive := self._known(values):
                yield drive
