"""Which found box is paired with which true one."""

import numpy as np
from numpy.typing import NDArray

from services.object_detection.boxes import Scores

Pair = tuple[int, int]


def best_pairs(scores: Scores, threshold: float) -> list[Pair]:
    """Pairs (row, column) of scores above a threshold: as many as can be, and of those the largest sum.

    Each row and column is in one pair at most. `scores` are from 0 to 1; a score equal to the threshold is no pair.
    """
    allowed = scores > threshold
    rows, columns = np.flatnonzero(allowed.any(1)), np.flatnonzero(allowed.any(0))
    if not len(rows):
        return []
    part, may = scores[np.ix_(rows, columns)], allowed[np.ix_(rows, columns)]
    more_than_all = min(part.shape) + 1.0
    gains = np.where(may, part + more_than_all, 0.0)
    turned = len(rows) > len(columns)
    chosen = _assigned(-gains.T if turned else -gains)
    pairs = [(int(b), a) if turned else (a, int(b)) for a, b in enumerate(chosen)]
    return sorted((int(rows[a]), int(columns[b])) for a, b in pairs if may[a, b])


def _assigned(costs: Scores) -> NDArray[np.int64]:
    """The column of each row so that the sum of costs is smallest; there are no more rows than columns.

    Rows join one by one, each along the shortest path of changes that frees a column (Kuhn 1955, in the form of
    Jonker and Volgenant 1987). Prices of rows and columns keep all reduced costs from being negative.
    """
    rows, columns = costs.shape
    row_price, column_price = np.zeros(rows), np.zeros(columns)
    column_of, row_of = np.full(rows, -1), np.full(columns, -1)
    for newcomer in range(rows):
        reduced = costs - row_price[:, None] - column_price
        lengths, came_from, settled, free = _shortest_path(reduced, row_of, newcomer)
        slack = np.where(settled, lengths[free] - lengths, 0.0)
        column_price -= slack
        row_price[newcomer] += lengths[free]
        moved = np.flatnonzero(settled & (row_of >= 0))
        row_price[row_of[moved]] += slack[moved]
        column = free
        while column >= 0:
            row = came_from[column]
            row_of[column] = row
            column_of[row], column = column, column_of[row]
    return column_of


def _shortest_path(
    reduced: Scores, row_of: NDArray[np.int64], start: int
) -> tuple[Scores, NDArray[np.int64], NDArray[np.bool_], int]:
    """Dijkstra's search from a row to the nearest column without a row.

    Gives each column's distance, the row before it, whether its distance is final, and the column that was found.
    """
    count = reduced.shape[1]
    lengths, came_from, settled = np.full(count, np.inf), np.full(count, -1), np.zeros(count, np.bool_)
    row, behind = start, 0.0
    while True:
        through = behind + reduced[row]
        shorter = ~settled & (through < lengths)
        lengths[shorter], came_from[shorter] = through[shorter], row
        column = int(np.argmin(np.where(settled, np.inf, lengths)))
        settled[column], behind = True, lengths[column]
        if row_of[column] < 0:
            return lengths, came_from, settled, column
        row = row_of[column]
