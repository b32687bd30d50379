"""Drives in a storage that workers share."""

import subprocess
import sys
from pathlib import Path

import pytest

from dodo_dsl.search import store as stores
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
        assert store.claim(DRIVE.values) == 0
        store.add(DRIVE)
        assert store.claim(CRASH.values) == 1
        store.add(CRASH)
    with opened(place, *WHAT) as store:
        assert store.known([{"x": "3 m"}, {"m": "ä", "x": "1 m"}, CRASH.values]) == [None, DRIVE, CRASH]
        assert store.claim(DRIVE.values) is None
    with opened(place, "test other", "other key") as store:
        assert store.get(DRIVE.values) is None
    with pytest.raises(OtherSearch, match="is of another test"), opened(place, "test main", "other key"):
        pass


def test_values_are_claimed_by_one_worker_until_it_gives_up(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with opened(place, *WHAT) as one, opened(place, *WHAT) as other:
        assert (one.claim(DRIVE.values), other.claim(DRIVE.values)) == (0, None)
        one.close()
        assert other.claim(DRIVE.values) is not None
        other.add(DRIVE)
        assert one.get(DRIVE.values) == DRIVE
        other.claim(later := {"x": "2 m"})
        assert one.claim(later) is None
        monkeypatch.setattr(stores, "PATIENCE_S", 0.0)
        assert one.claim(later) is not None, "it may be of a machine that is gone"


def test_a_worker_that_is_gone_claims_nothing(place: str) -> None:
    code = (
        "import os, sys; from dodo_dsl.search.store import Store; store = Store(*sys.argv[1:]); "
        "print(store.claim({'x': '1'}), flush=True); os.kill(os.getpid(), 9)"
    )
    words = [sys.executable, "-c", code, place, *WHAT]
    assert subprocess.run(words, capture_output=True, text=True, check=False).stdout == "0\n"
    with opened(place, *WHAT) as store:
        assert store.claim({"x": "1"}) == 1


def test_a_line_that_a_power_cut_left_unfinished_is_cut_off(tmp_path: Path) -> None:
    place = tmp_path / "search.journal"
    with opened(str(place), *WHAT) as store:
        store.claim(DRIVE.values)
        store.add(DRIVE)
    with place.open("a") as file:
        file.write('{"op_code": 4, "wor')
    for _ in range(2):
        with opened(str(place), *WHAT) as store:
            assert store.get(DRIVE.values) == DRIVE
            store.claim({"x": "7 m"})


def test_a_file_that_is_no_journal(tmp_path: Path) -> None:
    path = tmp_path / "search.journal"
    path.write_text("no journal\n" * 3)
    with pytest.raises(StorageProblem, match="cannot be used: "), opened(str(path), *WHAT):
        pass
