"""Drives in a database that several workers share."""

import os
import threading
import time
from dataclasses import replace

import pytest

from dodo_dsl.search import postgres
from dodo_dsl.search.postgres import AddressProblem, StorageProblem, masked, opened
from dodo_dsl.search.store import Drive, OtherSearch
from tests.search.database import Database

DRIVE = Drive(3, {"x": "1 m", "m": "ä"}, "failed", -0.1, "hit wall", "wall-margin")
PARTS = ("name", "test", "key")

pytestmark = pytest.mark.xdist_group("postgres")


@pytest.fixture
def address(database: Database) -> str:
    """Of a database without tables."""
    database.sql("drop table if exists dodo_drive, dodo_study")
    return database.address


@pytest.mark.slow
def test_drives_stay(address: str) -> None:
    with opened(address, *PARTS) as store:
        assert store.get(DRIVE.values) is None
        store.add(DRIVE)
        store.add(Drive(4, DRIVE.values, "passed", 1.0, ""))
    with opened(address, *PARTS) as store:
        assert store.known([{"x": "2 m"}, {"m": "ä", "x": "1 m"}]) == [None, DRIVE]
    with opened(address, "other", "test", "other key") as store:
        assert store.get(DRIVE.values) is None


@pytest.mark.slow
def test_tables_of_an_earlier_version_go_on(address: str, database: Database) -> None:
    with opened(address, *PARTS) as store:
        store.add(DRIVE)
    database.sql("alter table dodo_drive drop column checks")
    with opened(address, *PARTS) as store:
        assert store.get(DRIVE.values) == replace(DRIVE, checks="")
        store.add(other := replace(DRIVE, values={"x": "2 m"}))
        assert store.get(other.values) == other


@pytest.mark.slow
def test_a_reason_may_hold_any_character(address: str) -> None:
    with opened(address, *PARTS) as store:
        store.add(replace(DRIVE, reason="a\0b\udc80"))
        assert store.get(DRIVE.values) == replace(DRIVE, reason="a�b?")


@pytest.mark.slow
def test_values_are_claimed_by_one_worker_until_it_ends(address: str) -> None:
    with opened(address, *PARTS) as second:
        with opened(address, *PARTS) as first:
            assert first.claim(DRIVE.values)
            assert not second.claim(DRIVE.values)
            assert second.claim({"x": "2 m"})
        deadline = time.monotonic() + 30  # the server notices the end of a connection a moment later
        while not second.claim(DRIVE.values):
            assert time.monotonic() < deadline, "the first worker ended without its drive"
            second.wait()


@pytest.mark.slow
def test_what_another_worker_drove_is_not_claimed_again(address: str) -> None:
    with opened(address, *PARTS) as first, opened(address, *PARTS) as second:
        assert first.claim(DRIVE.values)
        assert second.known([DRIVE.values]) == [None]
        first.add(DRIVE)
        assert not second.claim(DRIVE.values)
        assert second.get(DRIVE.values) == DRIVE
    with opened(address, *PARTS) as third:
        assert not third.claim(DRIVE.values)


@pytest.mark.slow
def test_another_version_of_the_test_is_refused(address: str) -> None:
    with opened(address, *PARTS):
        pass
    with (
        pytest.raises(OtherSearch, match=r"the study 'name' of test at postgres.* is of another version .* --study"),
        opened(address, "name", "test", "other"),
    ):
        pass


@pytest.mark.slow
def test_workers_that_begin_at_once_make_the_tables_once(address: str) -> None:
    problems: list[Exception] = []

    def begin() -> None:
        try:
            with opened(address, *PARTS):
                pass
        except Exception as error:  # noqa: BLE001  (of a thread)
            problems.append(error)

    threads = [threading.Thread(target=begin) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert problems == []


@pytest.mark.slow
def test_a_server_that_goes_away_is_said(address: str, database: Database) -> None:
    with opened(address, *PARTS) as store:
        database.sql("select pg_terminate_backend(pid) from pg_stat_activity where application_name = 'dodo search'")
        with pytest.raises(StorageProblem, match="cannot be used: terminating connection"):
            store.add(DRIVE)


@pytest.mark.slow
def test_a_user_who_may_not_make_tables_is_told(address: str, database: Database) -> None:
    database.sql("drop role if exists guest; create role guest login; revoke create on schema public from public")
    with pytest.raises(StorageProblem, match="permission denied"), opened(database.address_of("guest"), *PARTS):
        pass


@pytest.mark.slow
@pytest.mark.parametrize("password", ["se%2Fc%40ret", "wrong", ""])
def test_a_password_is_never_shown(
    address: str, database: Database, password: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PGPASSWORD", raising=False)
    monkeypatch.setenv("PGPASSFILE", "/nowhere")
    database.sql("grant create on schema public to locked")
    own = database.address_of(f"locked:{password}" if password else "locked")
    if password.startswith("se"):
        with opened(own, *PARTS) as store:
            store.add(DRIVE)
            message = repr(store)
        with pytest.raises(OtherSearch) as other, opened(own, "name", "test", "other"):
            pass
        message += str(other.value)
    else:
        with pytest.raises(StorageProblem) as problem, opened(own, *PARTS):
            pass
        message = str(problem.value)
        assert "password" in message and "PGPASSWORD or ~/.pgpass" in message
        assert problem.value.__cause__ is None and problem.value.__suppress_context__
    assert "se%2Fc" not in message and "se/c" not in message and "wrong" not in message


@pytest.mark.slow
def test_the_application_inherits_no_password(
    address: str, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    database.sql("grant create on schema public to locked")
    monkeypatch.setenv("PGPASSWORD", "se/c@ret")
    monkeypatch.setenv("DODO_SEARCH_STORAGE", address)
    with opened(database.address_of("locked"), *PARTS):
        assert not {"PGPASSWORD", "DODO_SEARCH_STORAGE"} & os.environ.keys()


@pytest.mark.parametrize("host", ["127.0.0.1:1", "%2Fnowhere"])
def test_a_server_that_cannot_be_reached_is_said(host: str) -> None:
    pytest.importorskip("psycopg")
    with pytest.raises(StorageProblem) as problem, opened(f"postgresql://u:geheim@{host}/db", *PARTS):
        pass
    assert str(problem.value).startswith(f"postgresql://u:***@{host}/db cannot be used: ")
    assert "geheim" not in str(problem.value)


@pytest.mark.parametrize(
    "address",
    [
        "", "study.sqlite", "mysql://u:geheim@host/db", "postgresql:/u:geheim@host/db", "postgresql://u:ge/heim@host/db",
        "postgresql://u:geheim@heim@host/db", "postgresql://u:geheim%zz@host/db", "postgresql://u:geheim@host:port/db",
        "postgresql://u@host/db?pasword=geheim",
    ],
)  # fmt: skip
def test_an_address_that_cannot_be_read_is_not_repeated(address: str) -> None:
    pytest.importorskip("psycopg")
    with pytest.raises(AddressProblem, match="expected postgresql://USER@HOST/DATABASE") as problem:
        postgres.SharedStore(address, *PARTS)
    assert "heim" not in str(problem.value)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("postgresql://u:geheim@host/db", "postgresql://u:***@host/db"),
        ("postgres://u:ge@/:heim@host/db", "postgres://u:***@host/db"),
        ("'postgresql://u:ge heim@host/db' is", "'postgresql://u:***@host/db' is"),
        ("postgresql://:geheim@host", "postgresql://:***@host"),
        ("postgresql:/u:geheim@host", "postgresql:/u:***@host"),
        ("postgresql://u@host/db?password=geheim&x=1", "postgresql://u@host/db?password=***&x=1"),
        ("postgresql:///db?x=1&sslpassword=geheim", "postgresql:///db?x=1&sslpassword=***"),
        ("postgresql://u@host:5432/db", "postgresql://u@host:5432/db"),
        ("https://host:80/a@b", "https://host:80/a@b"),
    ],
)
def test_passwords_are_masked(text: str, shown: str) -> None:
    assert masked(text) == shown
