"""A truth on disk: its three files, and pictures that are given."""

from pathlib import Path

import numpy as np
import pytest

from dodo_dsl.atomic import OutputExists, refuse_existing
from dodo_dsl.rec import truth
from dodo_dsl.rec.truth import Mark, TruthError, TruthFiles, decoded, given

PICTURE = np.full((48, 64, 3), 90, np.uint8)


def test_the_files_and_what_is_in_them(tmp_path: Path) -> None:
    files = TruthFiles.beside(tmp_path / "new" / "desk.json")
    marks = [Mark("blue", 10, 12, 20, 16)]
    assert files.wanted(has_boxes=True, is_new=True) == [files.truth, files.marked, files.picture]
    assert files.wanted(has_boxes=False, is_new=True) == [files.picture]
    files.write(PICTURE, marks, is_new=True)
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["desk-boxes.png", "desk.json", "desk.png"]
    assert truth.read(files.truth, 64, 48) == marks
    assert (decoded(given(files.picture), "desk") == PICTURE).all(), "the picture is kept without loss"
    assert decoded(given(files.marked), "desk").shape == (96, 128, 3)


def test_a_snapshot_alone_has_no_truth(tmp_path: Path) -> None:
    files = TruthFiles.beside(tmp_path / "desk.json")
    files.write(PICTURE, [], is_new=True)
    assert [path.name for path in tmp_path.iterdir()] == ["desk.png"]


def test_what_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TruthError, match=r"expected a file that ends in \.json"):
        TruthFiles.beside(tmp_path / "desk.png")
    with pytest.raises(TruthError, match="cannot be read: No such file"):
        given(tmp_path / "none.png")
    for data in (b"", b"no picture"):
        with pytest.raises(TruthError, match="desk: not a readable image"):
            decoded(data, "desk")


def test_existing_files_are_replaced_only_by_force(tmp_path: Path) -> None:
    (tmp_path / "there").write_text("")
    paths = [tmp_path / "new", tmp_path / "there"]
    refuse_existing(paths, force=True)
    refuse_existing(paths[:1], force=False)
    with pytest.raises(OutputExists, match=r"there' exists already; --force replaces it"):
        refuse_existing(paths, force=False)
