"""One search by several workers, each a process, in a PostgreSQL database."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.check import examples
from tests.search.database import Database, served
from tests.search.scripted_drives import SPEC

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
_BEGUN: list[subprocess.Popen[str]] = []
RUNS = ("--runs", "20", "-j", "1")


@pytest.fixture(scope="module")
def database() -> Iterator[Database]:
    yield from served()


@pytest.fixture
def storage(database: Database) -> tuple[str, str]:
    database.sql("drop table if exists dodo_drive, dodo_study")
    return "--storage", database.address


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The repository of the test that is searched."""
    folder = tmp_path_factory.mktemp("repository")
    examples.write(SPEC, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("DODO_LEASES", str(folder / "leases"))
        patch.setenv("DODO_HISTORY", str(folder / "history.jsonl"))
        patch.setenv("PYTHONPATH", str(ROOT))
        yield folder


@pytest.fixture(autouse=True)
def no_worker_is_left() -> Iterator[None]:
    yield
    for process in _BEGUN:
        with process:
            process.kill()
    _BEGUN.clear()


@pytest.fixture(scope="module")
def alone(folder: Path, database: Database) -> str:
    """The name of a worker that has searched without a database; it is needed only where there is one."""
    assert end(worker("alone", *RUNS))[0] == 1
    return "alone"


def worker(name: str, *words: str, killed_at: int = 0) -> subprocess.Popen[str]:
    """Begins to search, with a report and a list of drives called ``name``."""
    command = [sys.executable, "-m", "tests.search.worker", f"{name}.txt", str(killed_at), "example"]
    command += ["--isolation", "host", "--report", name, *words]
    _BEGUN.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True))
    return _BEGUN[-1]


def end(process: subprocess.Popen[str]) -> tuple[int, str]:
    out, _ = process.communicate(timeout=300)
    return process.returncode, out


def wait_until(is_so: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.1)


def result(name: str) -> dict[str, Any]:
    return dict(json.loads(Path(name, "search", "example", "search.json").read_text()))


def begun(name: str) -> list[str]:
    return Path(f"{name}.txt").read_text().split()


def test_four_workers_of_which_one_is_killed_search_like_one(
    alone: str, database: Database, storage: tuple[str, str]
) -> None:
    names = ("a", "b", "c", "d")
    workers = [worker(name, *RUNS, *storage, killed_at=3 * (name == "a")) for name in names]
    ends = [end(each) for each in workers]
    assert [code for code, _ in ends] == [-signal.SIGKILL, 1, 1, 1], ends
    assert not Path("a", "search", "example", "search.json").exists()
    assert result("b") == result("c") == result("d") == result(alone)
    drives = {name: Counter(begun(name)) for name in (*names, alone)}
    assert all(drives[name] for name in names), "each drove"
    together = sum((drives[name] for name in names), Counter[str]())
    again = {slug: number - drives[alone][slug] for slug, number in together.items()}
    assert together.keys() == drives[alone].keys()
    lost = begun("a")[-1]  # which may have been its second try, after an error
    assert {slug: more for slug, more in again.items() if more} == {lost: begun("a").count(lost)}
    ((rows, points, numbers),) = database.sql(
        "select count(*), count(distinct point), count(distinct number) from dodo_drive"
    )
    assert rows == points == numbers == str(len(drives[alone]))


def test_an_interrupted_worker_goes_on_to_the_result_without_a_database(alone: str, storage: tuple[str, str]) -> None:
    assert end(worker("first", *RUNS, *storage, killed_at=11))[0] == -signal.SIGKILL
    code, out = end(worker("other", *RUNS, *storage, "--seed", "1"))
    assert code == 2 and "the study 'main' of example at postgresql://" in out and "another one with --study" in out
    assert end(worker("second", *RUNS, *storage))[0] == 1
    assert begun("first")[:-1] + begun("second") == begun(alone)
    assert end(worker("third", *RUNS, *storage, "--finish"))[0] == 1
    assert result("second") == result("third") == result(alone)
    assert not Path("third.txt").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_worker_that_waits_for_another_can_be_interrupted(
    database: Database, storage: tuple[str, str], number: signal.Signals
) -> None:
    name = f"stopped-{number.name}"
    stopped = worker(name, *RUNS, *storage)
    wait_until(Path(f"{name}.txt").exists)
    stopped.send_signal(signal.SIGSTOP)
    waiting = worker("waiting", *RUNS, *storage)
    tries = "select count(*) from pg_stat_activity where query like '%pg_try_advisory_lock%' and state = 'idle'"
    wait_until(lambda: database.sql(tries) != [["0"]])
    waiting.send_signal(number)
    code, out = end(waiting)
    assert (code, "the same command goes on from here" in out) == (130, True), out
    assert not Path("waiting.txt").exists()


def test_nothing_that_is_printed_or_kept_has_the_password(database: Database, storage: tuple[str, str]) -> None:
    database.sql("grant all on schema public to locked")
    words = ("--runs", "8", "--sweep", "--storage")
    code, out = end(worker("in", *words, database.address_of("locked:se%2Fc%40ret")))
    assert code == 1, out
    environment = {**os.environ, "PGPASSWORD": "wrong"}
    command = [sys.executable, "-m", "dodo_dsl", "search", "example", *words, database.address_of("locked")]
    refused = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert refused.returncode == 3 and "password authentication failed" in refused.stderr
    kept = [path.read_bytes() for path in Path().rglob("*") if path.is_file()]
    for secret in ("se%2Fc", "se/c"):
        assert secret not in out and not any(secret.encode() in content for content in kept)
    assert "wrong" not in refused.stdout + refused.stderr
