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
    """By what they hold, and neither small ones nor those of one test."""
    shared = standing_once(found(tmp_path, one="a.rec small.rec b.rec", two="a$2.rec small.rec", three="a.rec a$2.rec"))
    names = {slug: [copy.shared for copy in copied] for slug, copied in shared.items()}
    (first, *others) = names["one"]
    assert first == f"{hashlib.sha256(b'aaaaa').hexdigest()}-a_2.rec"
    assert (others, names["two"], names["three"]) == (["", ""], [first, ""], [first, first])
    assert [copy.target for copy in shared["three"]] == ["a.rec", "a$2.rec"]


@pytest.mark.usefixtures("large")
def test_what_the_repository_has_is_linked_whoever_needs_it(tmp_path: Path) -> None:
    (one,) = standing_once(found(tmp_path, one="a.rec small.rec"), lambda path: path.name == "a.rec")["one"][:1]
    assert one.is_linked and one.source == tmp_path / "a.rec"
    assert not any(copy.shared for copy in standing_once(found(tmp_path, one="a.rec"))["one"])


@pytest.mark.parametrize("target", ["a.rec", "recordings/a.rec", "deep/er/a.rec"])
def test_a_link_leads_to_the_shared_file_on_the_machine_and_in_containers(target: str) -> None:
    copy = FileCopy(target, Path("x"), "name")
    assert posixpath.normpath(f"generated/sil-a/files/{target}/../{copy.link}") == f"generated/{SHARED}/name"
    assert posixpath.normpath(f"/dodo/files/{target}/../{copy.link}") == f"/{SHARED}/name"


def test_shared_files_are_those_that_were_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    name = f"{hashlib.sha256(b'drive').hexdigest()}-a.rec"
    folder, shared = tmp_path / "out" / "dil-a", {"a.rec": name}
    (folder / "files").mkdir(parents=True)
    (folder / "files/a.rec").symlink_to(f"../../{SHARED}/{name}")
    place = folder.parent / SHARED
    place.mkdir()
    assert "has to stay with them" in file_problem(folder, shared)
    (place / name).symlink_to("../../a.rec")
    assert "'a.rec' is not in this checkout; commit it" in file_problem(folder, shared)
    (tmp_path / "a.rec").write_text("drive")
    assert file_problem(folder, shared) == ""
    (tmp_path / "a.rec").write_text("drives")
    assert "has the SHA-256" in file_problem(folder, shared)
    (tmp_path / "a.rec").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    assert "is a pointer of Git LFS: install git-lfs" in file_problem(folder, shared)
    (tmp_path / "a.rec").write_text("drive")
    (folder / "files/a.rec").unlink()
    assert "compile the test again" in file_problem(folder, shared)
