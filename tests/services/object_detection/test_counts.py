import numpy as np
import pytest
from hypothesis import strategies as st
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from services.object_detection.boxes import Box, Detections, LabelledBox, TypeNumber
from services.object_detection.score import Counts, CountsByClass, compare

A, B, FAR = Box(0, 0, 0.1, 0.1), Box(0.3, 0, 0.1, 0.1), Box(0.8, 0.8, 0.1, 0.1)
LABELS = ("yellow", "blue", "orange")
counts = st.integers(0, 1000)


def test_a_class_only_pairs_with_itself() -> None:
    true = [LabelledBox("yellow", A), LabelledBox("blue", B)]
    found = [LabelledBox("blue", A), LabelledBox("blue", B), LabelledBox("red", FAR)]
    counts = dict(compare(found, true, 0.5, ()))
    assert counts == {"yellow": Counts(0, 0, 1), "blue": Counts(1, 1, 0, 1.0), "red": Counts(0, 1, 0)}
    assert compare(found, true, 0.5, ()).total() == Counts(1, 2, 1, 1.0)
    assert dict(compare(found, true, 0.5, ["yellow", "blue"])).keys() == {"yellow", "blue"}


def test_parts_join_by_detection_id_whatever_their_order() -> None:
    detections = Detections()
    for number, value in (
        (1, "color:yellow"),
        (2, A),
        (1, B),
        (2, " blue "),
        (3, FAR),
        (4, A),
        (4, TypeNumber(2)),
        (5, "red"),
    ):
        detections.add(number, value)
    assert detections.labelled() == [
        LabelledBox("blue", A),
        LabelledBox("yellow", B),
        LabelledBox("", FAR),
        LabelledBox("type 2", A),
    ]


def coco_by_class(
    found: list[list[LabelledBox]], true: list[list[LabelledBox]], threshold: float
) -> dict[str, list[int]]:
    """TP, FP and FN of pycocotools by class, over all frames; a detection of another class is none."""
    dataset, ids = COCO(), {label: number for number, label in enumerate(LABELS, 1)}
    flat = [(image, one) for image, boxes in enumerate(true, 1) for one in boxes]
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
        for image, boxes in enumerate(found, 1)
        for t in boxes
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
        true = [
            LabelledBox(str(rng.choice(LABELS)), Box(*cells[cell], 0.12, 0.12)) for cell in rng.permutation(25)[:12]
        ]
        kept = [one for one in true if rng.random() < 0.8]
        labels = [str(rng.choice(LABELS)) if rng.random() < 0.2 else one.label for one in kept]
        moved = [Box(t.box[0] + rng.normal(0, 0.03), t.box[1] + rng.normal(0, 0.03), 0.12, 0.12) for t in kept]
        frames.append(([LabelledBox(label, box) for label, box in zip(labels, moved, strict=True)], true))
    ours = CountsByClass()
    for found, true in frames:
        for label, counts in compare(found, true, 0.5, ()):
            ours.add(label, counts)
    peers = coco_by_class([found for found, _ in frames], [true for _, true in frames], 0.5)
    assert {label: [t.hits, t.false, t.missed] for label, t in ours} == peers
    assert min(map(min, peers.values())) > 0
