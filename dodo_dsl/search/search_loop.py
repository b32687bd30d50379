"""A search: the nominal values and a course of drives, until all are done, or a failure ends it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from dodo_dsl.search.drives import Drives, point_at
from dodo_dsl.search.findings import Findings, find
from dodo_dsl.search.space import Candidate, Space, course, nominal, texts
from dodo_dsl.search.store import Drive, point_text
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.vary import Values

_TOGETHER = 8
"""Drives among which a failure is looked for at once where it ends the search."""


@dataclass
class SearchLoop:
    """``done`` are the candidates that were driven, in their order, without the nominal values.

    ``until_failure`` is whether it ends after the few drives of which one has failed.
    """

    spec: Spec
    space: Space
    runs: int
    seed: int
    drives: Drives
    until_failure: bool = False
    done: list[Candidate] = field(default_factory=list)

    async def follow(self) -> None:
        """Raises Interrupted."""
        await self._drive([nominal(self.space)], 0)
        candidates = list(course(self.space, self.runs, self.seed))
        size = _TOGETHER if self.until_failure else len(candidates)
        for begin in range(0, len(candidates), size):
            batch = candidates[begin : begin + size]
            try:
                await self._drive([one.values for one in batch], begin + 1)
            finally:
                self.done += [one for one in batch if self._known(one.values)]
            if self.ended_early:
                return

    async def _drive(self, candidates: Sequence[Values], first: int) -> None:
        await self.drives.drive([point_at(self.spec, values) for values in candidates], first)

    @property
    def ended_early(self) -> bool:
        """Whether a failure ended it."""
        return self.until_failure and bool(self.failed())

    def _known(self, values: Values) -> Drive | None:
        return self.drives.store.get(texts(values))

    def failed(self) -> list[tuple[Values, Drive]]:
        """The drives that failed, with their values."""
        drives = ((one.values, self._known(one.values)) for one in self.done)
        return [(values, drive) for values, drive in drives if drive and drive.outcome == "failed"]

    def findings(self) -> Findings:
        """What the drives say."""
        at_nominal, swept, others = self._known(nominal(self.space)), self._of(True), self._of(False)
        return find(self.spec.title, self.seed, self.space, at_nominal, swept, others, self.ended_early)

    def _of(self, is_swept: bool) -> list[Drive]:
        """The drives of the sweep, or those at the ends, each of their values once."""
        drives = (self._known(one.values) for one in self.done if one.swept is is_swept)
        return list({point_text(drive.values): drive for drive in drives if drive}.values())
