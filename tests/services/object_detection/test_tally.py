import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from services.object_detection.boxes import Box, Thing
from services.object_detection.counts import Tallies, Tally, compare
from services.object_detection.frames import Kind, Parts

A, B, FAR = Box(0, 0, 0.1, 0.1), Box(0.3, 0, 0.1, 0.1), Box(0.8, 0.8, 0.1, 0.1)
LABELS = ("yellow", "blue", "orange")
counts = st.integers(0, 1000)


@given(counts, counts, counts)
def test_precision_recall_and_f1_are_those_of_the_thesis(hits: int, false: int, missed: int) -> None:
    tally = Tally(hits, false, missed)
    p, r, f1 = tally.precision, tally.recall, tally.f1
    assert p == (hits / (hits + false) if hits + false else None)
    assert r == (hits / (hits + missed) if hits + missed else None)
    if p and r:
        assert f1 == pytest.approx(2 * p * r / (p + r))
    elif hits + false + missed:
        assert f1 == 0.0
    else:
        assert f1 is None


def test_a_class_only_pairs_with_itself() -> None:
    true = [Thing("yellow", A), Thing("blue", B)]
    found = [Thing("blue", A), Thing("blue", B), Thing("red", FAR)]
    tallies = dict(compare(found, true, 0.5, ()))
    assert tallies == {"yellow": Tally(0, 0, 1), "blue": Tally(1, 1, 0, 1.0), "red": Tally(0, 1, 0)}
    assert compare(found, true, 0.5, ()).total() == Tally(1, 2, 1, 1.0)
    assert dict(compare(found, true, 0.5, ["yellow", "blue"])).keys() == {"yellow", "blue"}


def test_a_threshold_is_to_be_exceeded() -> None:
    half = Box(0, 0, 0.1, 0.05)
    assert compare([Thing("a", half)], [Thing("a", A)], 0.5, ()).total() == Tally(0, 1, 1)
    assert compare([Thing("a", half)], [Thing("a", A)], 0.49, ()).total().hits == 1


def test_parts_join_by_detection_id_whatever_their_order() -> None:
    parts = Parts()
    for number, value in (
        (1, "color:yellow"),
        (2, A),
        (1, B),
        (2, " blue "),
        (3, FAR),
        (4, A),
        (4, Kind(2)),
        (5, "red"),
    ):
        parts.add(number, value)
    assert parts.things() == [Thing("blue", A), Thing("yellow", B), Thing("", FAR), Thing("type 2", A)]


def test_of_one_detection_the_first_word_counts() -> None:
    parts = Parts()
    for value in (A, B, B, "yellow", "blue", Kind(1), Kind(2)):
        parts.add(0, value)
    assert (parts.things(), parts.repeated) == ([Thing("yellow", A)], 2)


def test_no_property_is_no_class() -> None:
    parts = Parts()
    assert not parts
    parts.add(0, "")
    parts.add(0, A)
    assert parts and parts.things() == [Thing("", A)]


def coco_by_class(found: list[list[Thing]], true: list[list[Thing]], threshold: float) -> dict[str, list[int]]:
    """TP, FP and FN of pycocotools by class, over all frames; a detection of another class is none."""
    dataset, ids = COCO(), {label: number for number, label in enumerate(LABELS, 1)}
    flat = [(image, thing) for image, things in enumerate(true, 1) for thing in things]
    dataset.dataset = {
        "info": {},
        "images": [{"id": image, "width": 1, "height": 1} for image in range(1, len(true) + 1)],
        "categories": [{"id": number, "name": label} for label, number in ids.items()],
        "annotations": [
            {"id": i, "image_id": image, "category_id": ids[t.label], "bbox": list(t.box), "area": 1, "iscrowd": 0}
            for i, (image, t) in enumerate(flat, 1)
        ],
    }
    dataset.createIndex()
    results = [
        {"image_id": image, "category_id": ids[t.label], "bbox": list(t.box), "score": 1.0}
        for image, things in enumerate(found, 1)
        for t in things
    ]
    evaluation = COCOeval(dataset, dataset.loadRes(results), "bbox")
    evaluation.params.iouThrs = np.array([threshold])
    evaluation.params.areaRng, evaluation.params.areaRngLbl = [[0, 1e10]], ["all"]
    evaluation.evaluate()
    counts = {label: [0, 0, 0] for label in LABELS}
    for judged in filter(None, evaluation.evalImgs):
        hits = int((judged["dtMatches"] > 0).sum())
        here = (hits, judged["dtMatches"].size - hits, judged["gtMatches"].size - hits)
        label = LABELS[judged["category_id"] - 1]
        counts[label] = [one + other for one, other in zip(counts[label], here, strict=True)]
    return counts


@pytest.mark.parametrize("seed", range(10))
def test_classes_over_several_frames_against_pycocotools(seed: int) -> None:
    """Boxes stand apart; some are found elsewhere, as another class, or not at all."""
    rng = np.random.default_rng(seed)
    cells = [(x / 5, y / 5) for x in range(5) for y in range(5)]
    frames = []
    for _ in range(6):
        true = [Thing(str(rng.choice(LABELS)), Box(*cells[cell], 0.12, 0.12)) for cell in rng.permutation(25)[:12]]
        kept = [thing for thing in true if rng.random() < 0.8]
        labels = [str(rng.choice(LABELS)) if rng.random() < 0.2 else thing.label for thing in kept]
        moved = [Box(t.box[0] + rng.normal(0, 0.03), t.box[1] + rng.normal(0, 0.03), 0.12, 0.12) for t in kept]
        frames.append(([Thing(label, box) for label, box in zip(labels, moved, strict=True)], true))
    ours = Tallies()
    for found, true in frames:
        for label, tally in compare(found, true, 0.5, ()):
            ours.add(label, tally)
    peers = coco_by_class([found for found, _ in frames], [true for _, true in frames], 0.5)
    assert {label: [t.hits, t.false, t.missed] for label, t in ours} == peers
    assert min(map(min, peers.values())) > 0
