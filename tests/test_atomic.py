"""Whatever happens, a target is the old one or the new one, and no temporary file stays."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl import atomic


class Stop(Exception):
    """Any failure of the one who writes."""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def umask() -> Iterator[None]:
    """The permissions of new files are known: 0640, and 0750 of folders."""
    before = os.umask(0o027)
    yield
    os.umask(before)


def test_the_old_content_is_there_until_the_end(tmp_path: Path) -> None:
    path = tmp_path / "file.png"
    path.write_text("old")
    with atomic.replacing(path) as part:
        part.write_text("new")
        assert path.read_text() == "old"
        assert part.suffix == ".png", "programs choose a format by it"
    assert path.read_text() == "new"


def test_a_failure_leaves_the_old_content_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    with pytest.raises(Stop), atomic.replacing(path) as part:
        part.write_text("half")
        raise Stop
    assert path.read_text() == "old"
    assert names(tmp_path) == ["file"]


@pytest.mark.usefixtures("umask")
def test_a_new_file_follows_the_umask_and_a_replaced_one_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "file"
    atomic.write_text(path, "new")
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    path.chmod(0o604)
    atomic.write_text(path, "newer")
    assert stat.S_IMODE(path.stat().st_mode) == 0o604
    with atomic.new_folder(tmp_path / "folder"):
        pass
    assert stat.S_IMODE((tmp_path / "folder").stat().st_mode) == 0o750


def test_a_symlink_is_replaced_and_not_followed(tmp_path: Path) -> None:
    other, link = tmp_path / "other", tmp_path / "link"
    other.write_text("untouched")
    other.chmod(0o600)
    link.symlink_to(other)
    atomic.write_text(link, "new")
    assert not link.is_symlink()
    assert (link.read_text(), other.read_text()) == ("new", "untouched")
    assert stat.S_IMODE(link.stat().st_mode) != 0o600, "the permissions are not those of another file"


def test_a_folder_in_the_place_of_a_file_stays(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    (folder / "below").mkdir(parents=True)
    with pytest.raises(IsADirectoryError) as caught:
        atomic.write_text(folder, "new")
    assert caught.value.filename == str(folder), "an error names the target and no temporary file"
    assert names(tmp_path) == ["folder"]


def test_a_full_disk_leaves_the_old_content_and_room(small_disk: Path) -> None:
    path = small_disk / "file"
    path.write_text("old")
    with pytest.raises(OSError, match="No space left on device") as caught:
        atomic.write_bytes(path, bytes(200_000))
    assert caught.value.filename == str(path)
    assert path.read_text() == "old"
    assert names(small_disk) == ["file"]
    atomic.write_bytes(path, bytes(20_000))


def test_a_folder_appears_with_all_its_files(tmp_path: Path) -> None:
    folder = tmp_path / "above" / "folder"
    with atomic.new_folder(folder) as stage:
        (stage / "below").mkdir()
        (stage / "below" / "file").write_text("new")
        assert not folder.exists()
    assert (folder / "below" / "file").read_text() == "new"
    assert names(folder.parent) == ["folder"]


@pytest.mark.parametrize("other", ["folder", "file", "link"])
def test_a_folder_replaces_nothing(tmp_path: Path, other: str) -> None:
    place = tmp_path / "folder"
    if other == "folder":
        place.mkdir()
        (place / "theirs").write_text("untouched")
    elif other == "file":
        place.write_text("untouched")
    else:
        (tmp_path / "elsewhere").mkdir()
        place.symlink_to(tmp_path / "elsewhere")
    before = names(tmp_path)
    with pytest.raises(FileExistsError) as caught, atomic.new_folder(place) as stage:
        (stage / "ours").write_text("new")
    assert caught.value.filename == str(place)
    assert names(tmp_path) == before
    assert not (place / "ours").exists()


def test_files_join_what_a_folder_holds(tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.mkdir()
    (target / "kept").write_text("theirs")
    (target / "replaced").write_text("old")
    with atomic.files_into(target) as stage:
        (stage / "below").mkdir()
        (stage / "below" / "file").write_text("ours")
        (stage / "replaced").write_text("new")
        assert (target / "replaced").read_text() == "old"
    assert {p.relative_to(target).as_posix(): p.read_text() for p in target.rglob("*") if p.is_file()} == {
        "kept": "theirs",
        "replaced": "new",
        "below/file": "ours",
    }
    assert names(tmp_path) == ["target"]
