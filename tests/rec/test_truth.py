import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dodo_dsl.rec.truth import Mark, TruthError, check, drawn_boxes, mark, read, truth_text
from services.object_detection.boxes import load_truth

WIDTH, HEIGHT = 640, 480
starts = st.integers(0, 400).map(lambda thousandth: thousandth / 1.25)
sizes = st.integers(1, 1000).map(lambda part: part * 0.125)
marks = st.builds(Mark, st.sampled_from(["yellow", "blue", "café"]), starts, starts, sizes, sizes)
values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["id", "name", "bbox"]), inner),
    max_leaves=9,
)
entries = st.lists(
    st.fixed_dictionaries(
        {}, optional=dict.fromkeys(("id", "name", "width", "height", "bbox", "image_id", "category_id"), values)
    ),
    max_size=3,
)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One file for all examples: a folder each would take most of the time."""
    return tmp_path_factory.mktemp("truth") / "truth.json"


@given(st.lists(marks, min_size=1, max_size=9))
@pytest.mark.thorough
def test_what_is_written_is_read_here_and_by_the_evaluator(path: Path, written: list[Mark]) -> None:
    check(written, WIDTH, HEIGHT, ())
    path.write_text(truth_text(written, "truth.png", WIDTH, HEIGHT))
    assert read(path, WIDTH, HEIGHT) == written
    (things,) = load_truth(path, "one").pictures.values()
    assert [thing.label for thing in things] == [each.label for each in written]
    for thing, each in zip(things, written, strict=True):
        assert np.multiply(thing.box, (WIDTH, HEIGHT, WIDTH, HEIGHT)) == pytest.approx(each[1:])


@settings(max_examples=50)
@given(st.fixed_dictionaries({}, optional={"images": entries, "categories": entries, "annotations": entries}) | values)
@pytest.mark.thorough
def test_whatever_a_file_holds_is_refused_in_a_sentence(path: Path, document: object) -> None:
    path.write_text(json.dumps(document))
    with pytest.raises(TruthError, match=r"truth\.json:"):
        read(path, WIDTH, HEIGHT)


def test_a_file_too_deep_or_too_large(tmp_path: Path) -> None:
    path = tmp_path / "truth.json"
    for size, sentence in ((200_000, "nested too deeply"), (70_000_000, "larger than 67108864 bytes")):
        with path.open("w") as file:
            file.write("[" * 200_000)
            file.truncate(size)
        with pytest.raises(TruthError, match=sentence):
            read(path, WIDTH, HEIGHT)


@pytest.mark.parametrize("width", [64, 1280])
def test_boxes_are_drawn_where_they_are(width: int) -> None:
    picture = np.zeros((48, width, 3), np.uint8)
    scale = 2 if width == 64 else 1
    shown = drawn_boxes(picture, [mark("yellow", (10, 20, 30, 16), "box"), mark("blue", (50, 22, 9, 9), "box")])
    assert shown.shape == (48 * scale, width * scale, 3)
    lit = shown.any(axis=2)
    assert lit[20 * scale, 10 * scale : 39 * scale].all() and lit[20 * scale : 35 * scale, 10 * scale].all()
    assert not lit[22 * scale : 34 * scale, 12 * scale : 38 * scale].any()
    assert (shown[30 * scale, 10 * scale] != shown[30 * scale, 50 * scale]).any(), "each class has a colour"
    assert not picture.any()
