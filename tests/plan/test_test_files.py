"""Files that are copied beside a compiled test."""

import hashlib
import posixpath
from pathlib import Path

import pytest

from dodo_dsl.plan import test_files
from dodo_dsl.plan.test_files import SHARED, FileCopy, file_problem, standing_once


@pytest.fixture
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(test_files, "LARGE", 4)


def found(tmp_path: Path, **tests: str) -> dict[str, tuple[FileCopy, ...]]:
    """The files of tests by slug, each with the files that its text names, of which a letter is the content."""
    for name in {name for text in tests.values() for name in text.split()}:
        (tmp_path / name).write_text(name[0] * (2 if name.startswith("small") else 5))
    return {slug: tuple(FileCopy(name, tmp_path / name) for name in text.split()) for slug, text in tests.items()}


@pytest.mark.usefixtures("large")
def test_large_files_of_several_tests_stand_once(tmp_path: Path) -> None:
    """And neither small ones nor those of one test."""
    shared = standing_once(found(tmp_path, one="a$2.rec small.rec b.rec", two="a$2.rec small.rec", three="a.rec"))
    names = {slug: [copy.shared for copy in copied] for slug, copied in shared.items()}
    name = f"{hashlib.sha256(b'aaaaa').hexdigest()}-a_2.rec"
    assert names == {"one": [name, "", ""], "two": [name, ""], "three": [""]}


@pytest.mark.parametrize("target", ["a.rec", "recordings/a.rec", "deep/er/a.rec"])
def test_a_link_leads_to_the_shared_file_on_the_machine_and_in_containers(target: str) -> None:
    copy = FileCopy(target, Path("x"), "name")
    assert posixpath.normpath(f"generated/sil-a/files/{target}/../{copy.link}") == f"generated/{SHARED}/name"
    assert posixpath.normpath(f"/dodo/files/{target}/../{copy.link}") == f"/{SHARED}/name"


def test_a_shared_file_stays_beside_its_tests(tmp_path: Path) -> None:
    folder, place = tmp_path / "out/dil-a", tmp_path / "out" / SHARED / "0-a.rec"
    (folder / "files").mkdir(parents=True)
    (folder / "files/a.rec").symlink_to(f"../../{SHARED}/0-a.rec")
    assert "has to stay beside the compiled tests" in file_problem(folder, {"a.rec": "0-a.rec"})
    place.parent.mkdir()
    place.write_text("drive")
    assert file_problem(folder, {"a.rec": "0-a.rec"}) == ""
