"""The course of a search: generation after generation driven, until all are done or time is over."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from dodo_dsl.cli.search.drives import Drives, repeated
from dodo_dsl.search.findings import is_alike
from dodo_dsl.search.itinerary import FIRST, Candidate, Itinerary, key
from dodo_dsl.search.space import nominal, texts
from dodo_dsl.search.store import Drive, Store
from dodo_dsl.spec.instances.vary import Values


@dataclass
class Course:
    """Follows an itinerary; ``done`` are the candidates that were driven, in their order.

    ``until_failure`` is whether it ends after the few drives of which one has failed, and fails again. A drive that
    failed and did not when it was repeated has no outcome: its application may have got no processor.
    """

    itinerary: Itinerary
    store: Store
    until_failure: bool = False
    done: list[Candidate] = field(default_factory=list)

    async def follow(self, drives: Drives) -> None:
        """Drives the nominal values and the itinerary as far as time suffices. Raises Interrupted."""
        await drives.drive([nominal(self.itinerary.space)], 0)
        margins: dict[tuple[str, ...], float | None] = {}
        for generation in self.itinerary.generations(margins):
            size = FIRST if self.until_failure else len(generation)
            for begin in range(0, len(generation), size):
                batch = generation[begin : begin + size]
                try:
                    await drives.drive([one.values for one in batch], 1 + len(self.done))
                    if self.until_failure:
                        await self._repeat_failures(drives, batch)
                finally:
                    self._take(batch, margins)
                if any(key(one.values) not in margins for one in batch) or self.ended_early:
                    return

    @property
    def ended_early(self) -> bool:
        """Whether a failure ended it."""
        return self.until_failure and bool(self.failed())

    async def _repeat_failures(self, drives: Drives, batch: Sequence[Candidate]) -> None:
        for number, one in enumerate(batch, 1 + len(self.done)):
            if (drive := self._drive(one.values)) and drive.outcome == "failed":
                await drives.drive([one.values], number, 2)

    def _drive(self, values: Values) -> Drive | None:
        """The drive at some values, in error where it failed once and not again."""
        drive = self.store.get(texts(values))
        if drive is None or drive.outcome != "failed":
            return drive
        again = self.store.get(repeated(values, 2))
        if again is None or is_alike(drive, again):
            return drive
        return replace(drive, outcome="error", margin=None, reason=f"failed once and not again: {drive.reason}")

    def _take(self, batch: Sequence[Candidate], margins: dict[tuple[str, ...], float | None]) -> None:
        """What is known of the candidates, up to the first that was not driven.

        Margins are those of their first drives, whatever is repeated later, so that each search at the same values
        takes the same way.
        """
        for one in batch:
            drive = self.store.get(texts(one.values))
            if drive is None:
                return
            margins[key(one.values)] = drive.margin
            self.done.append(one)

    def failed(self) -> list[tuple[Values, Drive]]:
        """The drives that failed, with their values."""
        drives = ((one.values, self._drive(one.values)) for one in self.done)
        return [(values, drive) for values, drive in drives if drive and drive.outcome == "failed"]

    def known(self, swept: bool) -> list[Drive]:
        """The drives of the sweep, or those that were proposed, each of their values once."""
        return list(self._known(swept))

    def _known(self, swept: bool) -> Iterator[Drive]:
        chosen = {key(one.values): one.values for one in self.done if one.swept is swept}
        for values in chosen.values():
            if drive := self._drive(values):
                yield drive
