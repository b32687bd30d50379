"""Boxes of a truth file as labels of every frame."""

from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec.coco import of_truth
from dodo_dsl.rec.frames import IMAGE
from dodo_dsl.rec.truth import Mark, TruthError, truth_text
from tests.rec.conftest import BEGIN, video


def test_every_frame_has_the_boxes_as_fractions(record: Callable[..., Path], tmp_path: Path) -> None:
    truth = tmp_path / "truth.json"
    truth.write_text(truth_text([Mark("blue", 16, 12, 32, 24)], "a.png", 64, 48))
    with Recording(record(video(2))) as recording:
        found = of_truth(recording, recording.rows(messages=[IMAGE]), truth)
        assert sorted(found) == [BEGIN, BEGIN + 100_000]
        assert [(each.box, each.category) for each in found[BEGIN]] == [((0.25, 0.25, 0.5, 0.5), "blue")]
        truth.write_text(truth_text([], "a.png", 64, 48))
        with pytest.raises(TruthError, match="no boxes, expected at least one"):
            of_truth(recording, recording.rows(messages=[IMAGE]), truth)
