"""State between runs is kept where others cannot change it."""

import os
import stat
from pathlib import Path

import pytest

from dodo_dsl.run import leases
from dodo_dsl.state_folder import UnsafeFolder
from tests.hostile.command import STRANGER


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    return tmp_path / "leases"


def test_state_is_made_for_its_user_alone(folder: Path) -> None:
    before = os.umask(0)
    try:
        assert leases.lease_folder() == folder
    finally:
        os.umask(before)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o703])
def test_state_that_all_can_write_is_refused(folder: Path, mode: int) -> None:
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(UnsafeFolder, match="all users can write it, and so DoDo's state: chmod 700"):
        leases.try_lease("cid-130", {})
    assert list(folder.iterdir()) == []


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can make another user's folder")
def test_state_of_another_user_is_refused(folder: Path) -> None:
    folder.mkdir(mode=0o700)
    os.chown(folder, STRANGER, STRANGER)
    with pytest.raises(UnsafeFolder, match=f"belongs to user {STRANGER}, who could change DoDo's state"):
        leases.try_lease("cid-130", {})


def test_a_planted_symlink_is_not_written_through(folder: Path) -> None:
    folder.mkdir(mode=0o700)
    victim = folder.parent / "victim"
    victim.write_text("untouched")
    (folder / "cid-130.lease").symlink_to(victim)
    with pytest.raises(OSError, match="symbolic links"):
        leases.try_lease("cid-130", {})
    assert victim.read_text() == "untouched"
