from itertools import combinations, permutations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from services.object_detection.boxes import Scores, best_pairs

shapes = st.tuples(st.integers(0, 5), st.integers(0, 5))
scores = shapes.flatmap(lambda shape: arrays(np.float64, shape, elements=st.sampled_from([0, 0.2, 0.5, 0.6, 0.75, 1])))


def brute(table: Scores, threshold: float) -> tuple[int, float]:
    """The most pairs, and of those the largest sum, over all ways to pair."""
    rows, columns = table.shape
    best = (0, 0.0)
    for count in range(1, min(rows, columns) + 1):
        for chosen in combinations(range(rows), count):
            for other in permutations(range(columns), count):
                values = [table[pair] for pair in zip(chosen, other, strict=True)]
                if all(value > threshold for value in values):
                    best = max(best, (count, round(float(sum(values)), 9)))
    return best


@given(scores, st.sampled_from([0.0, 0.2, 0.5, 0.9]))
def test_pairs_are_the_best_of_all_ways_to_pair(table: Scores, threshold: float) -> None:
    pairs = best_pairs(table, threshold)
    assert all(table[pair] > threshold for pair in pairs)
    assert len({row for row, _ in pairs}) == len({column for _, column in pairs}) == len(pairs)
    assert (len(pairs), round(float(sum(table[pair] for pair in pairs)), 9)) == brute(table, threshold)
