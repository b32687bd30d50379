import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from pycocotools import mask

from services.object_detection.boxes import Box, overlaps

sizes = st.integers(100, 10_000).map(lambda n: n / 10_000)
places = st.integers(-5_000, 10_000).map(lambda n: n / 10_000)
boxes = st.builds(Box, places, places, sizes, sizes)
UNIT = Box(0, 0, 1, 1)


@given(st.lists(boxes, max_size=6), st.lists(boxes, max_size=6))
@pytest.mark.thorough
def test_overlaps_are_those_of_pycocotools_and_shapely(found: list[Box], true: list[Box]) -> None:
    scores = overlaps(found, true)
    assert scores.shape == (len(found), len(true))
    if found and true:
        peer = mask.iou(np.array(found, np.float64), np.array(true, np.float64), [0] * len(true))
        assert scores == pytest.approx(peer, abs=1e-9)
    for row, a in enumerate(found):
        for column, b in enumerate(true):
            one, other = (shapely.box(x, y, x + w, y + h) for x, y, w, h in (a, b))
            expected = one.intersection(other).area / one.union(other).area
            assert scores[row, column] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    "bad",
    [
        Box(0, 0, 0, 1),
        Box(0, 0, -1, -1),
        Box(1, 1, -1, -1),
        Box(math.nan, 0, 1, 1),
        Box(0, 0, math.inf, 1),
        Box(-math.inf, 0, math.inf, 1),
        Box(0, 0, 1e308, 1e308),
        Box(-1e308, 0, 1.7e308, 1.7e308),
    ],
)
def test_boxes_that_are_none_agree_with_nothing(bad: Box) -> None:
    assert overlaps([bad], [UNIT, bad]).tolist() == [[0.0, 0.0]]
