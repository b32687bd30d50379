from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from services.object_detection.boxes import Box, LabelledBox, Scores, best_pairs, overlaps
from services.object_detection.score import compare

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


def coco_counts(found: list[Box], true: list[Box], threshold: float) -> tuple[int, int, int]:
    """TP, FP and FN of pycocotools for one picture, a class and detections of one score."""
    dataset = COCO()
    dataset.dataset = {
        "info": {},
        "images": [{"id": 1, "width": 1, "height": 1}],
        "categories": [{"id": 1, "name": "cone"}],
        "annotations": [
            {"id": i, "image_id": 1, "category_id": 1, "bbox": list(b), "area": b.width * b.height, "iscrowd": 0}
            for i, b in enumerate(true, 1)
        ],
    }
    dataset.createIndex()
    results = [{"image_id": 1, "category_id": 1, "bbox": list(box), "score": 1.0} for box in found]
    evaluation = COCOeval(dataset, dataset.loadRes(results), "bbox")
    evaluation.params.iouThrs = np.array([threshold])
    evaluation.params.areaRng, evaluation.params.areaRngLbl = [[0, 1e10]], ["all"]
    evaluation.evaluate()
    hits = int((evaluation.evalImgs[0]["dtMatches"] > 0).sum())
    return hits, len(found) - hits, len(true) - hits


def counts(found: list[Box], true: list[Box], threshold: float) -> tuple[int, int, int]:
    total = compare([LabelledBox("a", b) for b in found], [LabelledBox("a", b) for b in true], threshold, ()).total()
    return total.hits, total.false, total.missed


@pytest.mark.parametrize("seed", range(60))
def test_counts_against_pycocotools(seed: int) -> None:
    """COCO pairs greedily and by scores: it never finds more pairs, and as many where no box has two candidates."""
    rng = np.random.default_rng(seed)
    true = [Box(*row) for row in rng.uniform((0, 0, 0.05, 0.05), (0.8, 0.8, 0.3, 0.3), (8, 4))]
    moved = rng.permutation([np.array(box) + rng.normal(0, 0.02, 4) for box in true])[: rng.integers(1, 9)]
    found = [*(Box(*row) for row in moved), *(Box(*row) for row in rng.uniform(0.05, 0.4, (3, 4)))]
    peer, ours = coco_counts(found, true, 0.5), counts(found, true, 0.5)
    assert ours[0] >= peer[0]
    candidates = overlaps(found, true) > 0.5
    if candidates.sum(0).max() <= 1 and candidates.sum(1).max() <= 1:
        assert ours == peer


def test_the_comparison_with_pycocotools_is_not_empty() -> None:
    """Of a pair that shares candidates greedy matching finds one; the best assignment both."""
    true = [Box(0, 0, 1, 1), Box(0.3, 0, 1, 1)]
    found = [Box(0.14, 0, 1, 1), Box(-0.2, 0, 1, 1)]
    assert counts(found, true, 0.5) == (2, 0, 0)
    true, found = [Box(0, 0, 0.2, 0.2), Box(0.5, 0.5, 0.2, 0.2)], [Box(0.01, 0, 0.2, 0.2), Box(0.1, 0.7, 0.2, 0.2)]
    assert counts(found, true, 0.5) == coco_counts(found, true, 0.5) == (1, 1, 1)
