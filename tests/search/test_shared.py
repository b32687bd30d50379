"""One search by several workers, each a process, in a PostgreSQL database."""

import json
import multiprocessing
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from multiprocessing.context import ForkProcess
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.plan.model import Plan
from tests.run.scripted import ScriptedBackend
from tests.search.database import Database
from tests.search.scripted_drives import SPEC, repository, stages, stub

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("postgres")]

_FORKS = multiprocessing.get_context("fork")
_FORKS = multiprocessing.get_context("fork")
_BEGUN: list[ForkProcess] = []
RUNS = ("--runs", "16", "-j", "1")
NOMINAL = "example--run-0"


@pytest.fixture
def storage(database: Database) -> tuple[str, str]:
    database.sql("drop table if exists dodo_drive, dodo_study")
    return "--storage", database.address


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The repository of the test that is searched."""
    folder = tmp_path_factory.mktemp("repository")
    with repository(folder, SPEC):
        yield folder


@pytest.fixture(autouse=True)
def no_worker_is_left() -> Iterator[None]:
    yield
    for process in _BEGUN:
        process.kill()
        process.join()
    _BEGUN.clear()


@pytest.fixture(scope="module")
def alone(folder: Path, database: Database) -> str:
    """The name of a worker that has searched without a database; it is needed only where there is one."""
    assert end(worker("alone", *RUNS))[0] == 1
    return "alone"


def worker(
    name: str,
    *words: str,
    signals: Mapping[int, int] = {},
    together: Sequence[str] = (),
    password: str = "",
) -> ForkProcess:
    """Begins to search, with a report, a list of drives and an output called ``name``.

    The process, a fork of this one, which has loaded everything, sends itself ``signals`` in its drives by their
    numbers, 0 in the nominal one. It ends its first one only when workers called ``together`` have begun theirs.
    """
    own = (name, words, signals, together, password)
    process = _FORKS.Process(target=_work, name=name, args=own, daemon=True)
    _BEGUN.append(process)
    process.start()
    return process


def _work(name: str, words: Sequence[str], signals: Mapping[int, int], together: Sequence[str], password: str) -> None:
    def backend(plan: Plan, attempt: int) -> ScriptedBackend:
        with Path(f"{name}.txt").open("a") as written:
            written.write(f"{plan.slug}\n")
        number = 0 if plan.slug == NOMINAL else len(others_than_nominal(name))
        while number and not all(map(others_than_nominal, together)):
            time.sleep(0.02)
        if number in signals:
            os.kill(os.getpid(), signals[number])
        return ScriptedBackend(plan, stages(plan))

    stub(pytest.MonkeyPatch(), backend)
    if password:
        os.environ["PGPASSWORD"] = password
    with Path(f"{name}.log").open("w") as log:
        code = main(["search", "example", "--isolation", "host", "--report", name, *words], log, log)
    sys.exit(code)


def end(process: ForkProcess) -> tuple[int | None, str]:
    """The exit code of a worker, and what it has printed."""
    process.join(120)
    return process.exitcode, Path(f"{process.name}.log").read_text()


def wait_until(is_so: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def result(name: str) -> dict[str, Any]:
    return dict(json.loads(Path(name, "search", "example", "search.json").read_text()))


def begun(name: str) -> list[str]:
    """The drives of a worker, which have begun."""
    path = Path(f"{name}.txt")
    return path.read_text().split() if path.exists() else []


def others_than_nominal(name: str) -> list[str]:
    return [slug for slug in begun(name) if slug != NOMINAL]


def test_four_workers_of_which_one_is_killed_search_like_one(
    alone: str, database: Database, storage: tuple[str, str]
) -> None:
    names = ("a", "b", "c", "d")
    killed = {"a": dict.fromkeys((1, 2), signal.SIGKILL)}
    workers = [worker(name, *RUNS, *storage, signals=killed.get(name, {}), together=names) for name in names]
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
    assert end(worker("first", *RUNS, *storage, signals={10: signal.SIGKILL}))[0] == -signal.SIGKILL
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
    worker(name, *RUNS, *storage, signals={0: signal.SIGSTOP})
    wait_until(lambda: bool(begun(name)))
    waiting = worker("waiting", *RUNS, *storage)
    tries = "select count(*) from pg_stat_activity where query like '%pg_try_advisory_lock%' and state = 'idle'"
    wait_until(lambda: database.sql(tries) != [["0"]])
    os.kill(waiting.pid or 0, number)
    code, out = end(waiting)
    assert (code, "the same command goes on from here" in out) == (130, True), out
    assert not Path("waiting.txt").exists()


def test_nothing_that_is_printed_or_kept_has_the_password(database: Database, storage: tuple[str, str]) -> None:
    database.sql("grant all on schema public to locked")
    words = ("--runs", "8", "--sweep", "--storage")
    code, out = end(worker("in", *words, database.address_of("locked:se%2Fc%40ret")))
    assert code == 1, out
    code, refused = end(worker("refused", *words, database.address_of("locked"), password="wrong"))
    assert code == 3 and "password authentication failed" in refused
    kept = [path.read_bytes() for path in Path().rglob("*") if path.is_file()]
    for secret in ("se%2Fc", "se/c"):
        assert secret not in out and not any(secret.encode() in content for content in kept)
    assert "wrong" not in refused
