"""Drives in a storage that workers share."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.search.store import Drive, OtherSearch, StorageProblem, opened

DRIVE = Drive(3, {"x": "1 m", "m": "ä"}, "failed", -0.1, "hit wall \0\udc80", "wall-margin")
CRASH = Drive(4, {"x": "2 m"}, "error", None, "")
WHAT = ("test main", "key")


@pytest.fixture(params=["{}/new/search.journal", pytest.param("sqlite:///{}/drives.db", marks=pytest.mark.thorough)])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    return str(request.param.format(tmp_path))


def test_drives_stay(place: str) -> None:
    with opened(place, *WHAT) as store:
        assert store.get(DRIVE.values) is None
        store.add(DRIVE)
        store.add(CRASH)
    with opened(place, *WHAT) as store:
        assert store.known([{"x": "3 m"}, {"m": "ä", "x": "1 m"}, CRASH.values]) == [None, DRIVE, CRASH]
    with opened(place, "test other", "other key") as store:
        assert store.get(DRIVE.values) is None
    with pytest.raises(OtherSearch, match="is of another test"), opened(place, "test main", "other key"):
        pass


def test_workers_see_the_drives_of_others_and_the_first_of_two_counts(place: str) -> None:
    with opened(place, *WHAT) as one, opened(place, *WHAT) as other:
        one.add(DRIVE)
        other.add(replace(DRIVE, number=7))
        other.add(CRASH)
        assert one.known([DRIVE.values, CRASH.values]) == other.known([DRIVE.values, CRASH.values]) == [DRIVE, CRASH]


def test_a_file_that_is_no_journal(tmp_path: Path) -> None:
    path = tmp_path / "search.journal"
    path.write_text("no journal\n" * 3)
    with pytest.raises(StorageProblem, match="cannot be used: "), opened(str(path), *WHAT):
        pass
