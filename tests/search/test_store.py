"""Drives in a file."""

import contextlib
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.search.store import FILE_NAME, Drive, OtherSearch, opened

DRIVE = Drive(3, {"x": "1 m", "m": "ä"}, "failed", -0.1, "hit wall")


def test_drives_stay(tmp_path: Path) -> None:
    with opened(tmp_path / "new", "key") as store:
        assert store.get(DRIVE.values) is None
        store.add(DRIVE)
    with opened(tmp_path / "new", "key") as store:
        assert store.get({"m": "ä", "x": "1 m"}) == DRIVE


def test_the_first_drive_at_some_values_stays(tmp_path: Path) -> None:
    with opened(tmp_path, "key") as store:
        store.add(DRIVE)
        store.add(Drive(4, DRIVE.values, "passed", 1.0, ""))
        assert store.get(DRIVE.values) == DRIVE


def test_a_file_of_an_earlier_version_goes_on(tmp_path: Path) -> None:
    with opened(tmp_path, "key") as store:
        store.add(replace(DRIVE, checks="wall-margin"))
    with contextlib.closing(sqlite3.connect(tmp_path / FILE_NAME)) as file, file:
        file.execute("alter table drives drop column checks")
    with opened(tmp_path, "key") as store:
        assert store.get(DRIVE.values) == DRIVE
        store.add(other := Drive(4, {"x": "2 m", "m": "ä"}, "failed", -0.1, "hit wall", "wall-margin"))
        assert store.get(other.values) == other


def test_another_study_is_refused(tmp_path: Path) -> None:
    with opened(tmp_path, "key"):
        pass
    with pytest.raises(OtherSearch, match="is of another test"), opened(tmp_path, "other"):
        pass


def test_a_file_that_others_lock_is_an_error_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    connect = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", lambda path: connect(path, timeout=0))
    with opened(tmp_path, "key") as store, contextlib.closing(connect(tmp_path / FILE_NAME)) as other:
        other.execute("begin exclusive")
        with pytest.raises(OtherSearch, match="cannot be used: database is locked"):
            store.add(DRIVE)
        with pytest.raises(OtherSearch, match="cannot be used: database is locked"):
            store.get(DRIVE.values)


def test_a_file_that_is_no_store(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text("no database, but long enough to be read as one" * 100)
    with pytest.raises(OtherSearch, match="cannot be used: file is not a database"), opened(tmp_path, "key"):
        pass
