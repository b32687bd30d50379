"""The order in which a search drives: a sweep, and by turns with it what the optimiser proposes.

It is the same for every number of drives, so that a search with more of them goes on with one that had fewer, and it
depends on nothing but the seed and what earlier drives said, so that it is the same however many run at once.
"""

import itertools
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from dodo_dsl.search.optimiser import Tried, propose
from dodo_dsl.search.space import Space, sweep, texts
from dodo_dsl.spec.instances.vary import Values

Margins = dict[tuple[str, ...], float | None]
"""The margin of drives by the texts of their values, None for one in error."""
FIRST, SWEPT, PROPOSED = 8, 4, 4
"""Drives of the sweep before the first proposals, and those of each later generation."""
PATIENCE = 12
"""Generations whose proposals may all pass; from then on, all but one drive of each are of the sweep.

The margin says nothing of a failure then, and what lies within the ranges is found soonest by an even cover.
"""


@dataclass(frozen=True)
class Candidate:
    """Values to be driven; ``swept`` is whether they belong to the sweep, which tells how often the test fails."""

    values: Values
    swept: bool


Judge = Callable[[Sequence[Candidate], Margins], Awaitable[bool]]
"""Drives candidates and adds their margins; says whether to go on."""


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
