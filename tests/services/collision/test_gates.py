"""Gates against shapely: the crossings of a whole path, cut by brute force."""

import math
from itertools import pairwise

import pytest
import shapely
from hypothesis import assume, example, given
from hypothesis import strategies as st

from dodo_dsl.opendlv.assets.track import Gate, Gates, VehiclePose

# The path has its corners at whole numbers and the gates theirs aside, so that none lies on the other.
corners = st.lists(st.tuples(st.integers(-6, 6), st.integers(-6, 6)), min_size=2, max_size=12)
places = st.integers(-6, 6)
lines = st.builds(
    lambda x1, y1, x2, y2: ((x1 + 0.137, y1 + 0.419), (x2 + 0.729, y2 + 0.253)), places, places, places, places
)
orders = st.lists(st.sampled_from("abc"), max_size=6)


def gate(name: str, *ends: tuple[float, float]) -> Gate:
    return name, shapely.MultiLineString([ends])


def drive(gates: Gates, *places: tuple[float, float]) -> list[float | None]:
    return [gates.move(VehiclePose(*a, 0), VehiclePose(*b, 0)) for a, b in pairwise(places)]


def brute(order: list[Gate], path: list[tuple[int, int]]) -> tuple[int, int | None]:
    """How many gates were crossed, and in which move the last of them, by shapely's points on each move."""
    seen = []
    for number, (a, b) in enumerate(pairwise(path)):
        move = shapely.LineString([a, b])
        for name, line in dict(order).items():
            point = move.intersection(line)
            if a != b and not point.is_empty:
                seen.append((number, math.dist(a, (point.x, point.y)), name))
    seen.sort()
    assume(all(one[0] != other[0] or other[1] - one[1] > 1e-9 for one, other in pairwise(seen)))
    crossed, last = 0, None
    for number, _, name in seen:
        if crossed < len(order) and order[crossed][0] == name:
            crossed, last = crossed + 1, number
    return crossed, last if crossed == len(order) else None


@given(corners, st.tuples(lines, lines, lines), orders)
@example([(0, 0), (5, 0)], (((1.1, -1.0), (1.2, 1.0)), ((3.1, -1.0), (3.2, 1.0)), ((0.1, 1.0), (0.2, 2.0))), ["b", "a"])
def test_gates_are_counted_as_shapely_finds_them(
    path: list[tuple[int, int]],
    ends: tuple[tuple[tuple[float, float], tuple[float, float]], ...],
    order: list[str],
) -> None:
    known = dict(gate(name, *line) for name, line in zip("abc", ends, strict=True))
    wanted = [(name, known[name]) for name in order]
    gates = Gates(wanted)
    moves = drive(gates, *path)
    crossed, last = brute(wanted, path)
    assert gates.crossed == crossed
    done = [number for number, share in enumerate(moves) if share is not None]
    assert done == (list(range(last or 0, len(moves))) if crossed == len(order) else [])


@pytest.mark.parametrize("stops", [[0.5], [1.0], [0.99999, 1.0, 1.00001]])
@pytest.mark.parametrize("is_back", [False, True])
def test_a_stop_on_the_line_is_one_crossing(stops: list[float], is_back: bool) -> None:
    gates = Gates([gate("a", (1, -1), (1, 1))] * 2)
    places = [(0.0, 0.0), *((x, 0.0) for x in stops), (2.0, 0.0)]
    drive(gates, *(places[::-1] if is_back else places))
    assert gates.crossed == 1
