"""The loop of a search, and its order: generations are driven until all are done, time is over or a failure ends it.

The order is a sweep, and by turns with it what the optimiser proposes. It is the same for every number of drives, so
that a search with more of them goes on with one that had fewer, and it depends on nothing but the seed and what earlier
drives said, so that it is the same however many run at once.
"""

import itertools
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from dodo_dsl.search.drives import Drives, drive_name, point_at
from dodo_dsl.search.findings import Findings, find, is_alike
from dodo_dsl.search.optimiser import Tried, propose
from dodo_dsl.search.space import Space, nominal, sweep, texts
from dodo_dsl.search.store import Drive
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.vary import Values

Margins = dict[tuple[str, ...], float | None]
"""The margin of drives by the texts of their values, None for one in error."""
FIRST, SWEPT, PROPOSED = 8, 4, 4
"""Drives of the sweep before the first proposals, and those of each later generation."""
PATIENCE = 12
"""Generations whose proposals may all pass; from then on, all but one drive of each are of the sweep.

The margin shows nothing about a failure then, and what lies within the ranges is found soonest by an even cover.
"""


@dataclass(frozen=True)
class Candidate:
    """Values to be driven; ``swept`` is whether they belong to the sweep, which shows how often the test fails."""

    values: Values
    swept: bool


Judge = Callable[[Sequence[Candidate], Margins], Awaitable[bool]]
"""Drives candidates and adds their margins; shows whether to go on."""


@dataclass(frozen=True)
class SamplingOrder:
    """``runs`` drives in a space; ``proposes`` is whether the optimiser takes part.

    With ``seeks_best`` it looks for the least margin alone, as a tuning does with negative ones, and not for failures
    of each kind. ``swept`` of the drives of each later generation are of the sweep.
    """

    space: Space
    runs: int
    seed: int
    proposes: bool = True
    seeks_best: bool = False
    swept: int = SWEPT

    async def follow(self, judge: Judge, most: int | None = None) -> None:
        """Has all candidates judged, up to ``most`` of a generation at once, or as far as ``judge`` goes on."""
        margins: Margins = {}
        for generation in self.generations(margins):
            size = most or len(generation)
            for begin in range(0, len(generation), size):
                if not await judge(generation[begin : begin + size], margins):
                    return

    def generations(self, margins: Mapping[tuple[str, ...], float | None]) -> Iterator[list[Candidate]]:
        """Candidates to be driven before the next ones are asked for; ``margins`` grows meanwhile.

        Raises KeyError for values that were not driven.
        """
        points = sweep(self.space, self.runs, self.seed)
        done: list[Candidate] = []
        number, is_exhausted = 0, False
        while len(done) < self.runs and not is_exhausted:
            size = SWEPT + PROPOSED
            proposed_now = size - self.swept if number <= PATIENCE or _has_failed(done, margins) else 1
            first = self.runs if not self.proposes else FIRST if number == 0 else size - proposed_now
            batch = [Candidate(values, True) for values in itertools.islice(points, first)]
            if number and self.proposes:
                tried = list(_tried(self.space, done, margins))
                seen = {key(one.values) for one in (*done, *batch)}
                proposed = propose(self.space, tried, seen, proposed_now, (self.seed, number), self.seeks_best)
                is_exhausted = bool(tried) and not proposed
                batch += [Candidate(values, False) for values in proposed]
            batch = batch[: self.runs - len(done)]
            yield batch
            done += batch
            number += 1


def _has_failed(done: Sequence[Candidate], margins: Mapping[tuple[str, ...], float | None]) -> bool:
    return any((margins[key(one.values)] or 0.0) < 0 for one in done)


def key(values: Values) -> tuple[str, ...]:
    return tuple(texts(values).values())


def _tried(space: Space, done: Sequence[Candidate], margins: Mapping[tuple[str, ...], float | None]) -> Iterator[Tried]:
    """Each of the values once."""
    for one in {key(candidate.values): candidate for candidate in done}.values():
        margin = margins[key(one.values)]
        if margin is not None:
            yield Tried(space.point(texts(one.values)), margin)


@dataclass
class SearchLoop:
    """Follows an order; ``done`` are the candidates that were driven, in their order.

    ``until_failure`` is whether it ends after the few drives of which one has failed, and fails again. A drive that
    failed and did not when it was repeated has no outcome: its application may have got no processor.
    """

    spec: Spec
    order: SamplingOrder
    drives: Drives
    until_failure: bool = False
    done: list[Candidate] = field(default_factory=list)

    async def follow(self) -> None:
        """Drives the nominal values and the order, as far as time suffices. Raises Interrupted."""
        await self._drive([nominal(self.order.space)], 0)
        await self.order.follow(self._judge, FIRST if self.until_failure else None)

    async def _judge(self, batch: Sequence[Candidate], margins: Margins) -> bool:
        try:
            await self._drive([one.values for one in batch], 1 + len(self.done))
            if self.until_failure:
                await self._repeat_failures(batch)
        finally:
            self._take(batch, margins)
        return all(key(one.values) in margins for one in batch) and not self.ended_early

    async def _drive(self, candidates: Sequence[Values], first: int, repeat: int = 1) -> None:
        await self.drives.drive([point_at(self.spec, values, repeat) for values in candidates], first)

    @property
    def ended_early(self) -> bool:
        """Whether a failure ended it."""
        return self.until_failure and bool(self.failed())

    async def _repeat_failures(self, batch: Sequence[Candidate]) -> None:
        for number, one in enumerate(batch, 1 + len(self.done)):
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

    def _take(self, batch: Sequence[Candidate], margins: Margins) -> None:
        """What is known of the candidates, up to the first that was not driven.

        Margins are those of their first drives, whatever is repeated later, so that each search at the same values
        takes the same way.
        """
        for one in batch:
            drive = self.drives.store.get(drive_name(one.values))
            if drive is None:
                return
            margins[key(one.values)] = drive.margin
            self.done.append(one)

    def failed(self) -> list[tuple[Values, Drive]]:
        """The drives that failed, with their values."""
        drives = ((one.values, self._known(one.values)) for one in self.done)
        return [(values, drive) for values, drive in drives if drive and drive.outcome == "failed"]

    def findings(self) -> Findings:
        """What the drives say."""
        space, seed = self.order.space, self.order.seed
        at_nominal = self.drives.store.get(drive_name(nominal(space)))
        swept, proposed = ([*self._of(is_swept)] for is_swept in (True, False))
        found = find(self.spec.title, seed, space, at_nominal, swept, proposed)
        return replace(found, ended_early=self.ended_early)

    def _of(self, swept: bool) -> Iterator[Drive]:
        """The drives of the sweep, or those that were proposed, each of their values once."""
        chosen = {key(one.values): one.values for one in self.done if one.swept is swept}
        for values in chosen.values():
            if drive := self._known(values):
                yield drive
