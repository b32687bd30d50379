"""``dodo search`` with drives whose end follows from their values."""

import json
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl import advice, compiler
from dodo_dsl.cli import selection
from dodo_dsl.cli.main import main
from dodo_dsl.plan.model import Plan
from tests.check import examples
from tests.run.scripted import ScriptedBackend
from tests.search.scripted_drives import LIMIT, SPEC, scripted_commands, stages, start_of


@dataclass
class Search:
    """``dodo search`` in a folder of its own; Ctrl-C comes when drive number ``ends_at`` begins."""

    ends_at: int | None = None
    driven: list[str] = field(default_factory=list)
    report: str = ""

    def backend(self, plan: Plan, attempt: int) -> ScriptedBackend:
        self.driven.append(plan.slug)
        if len(self.driven) == self.ends_at:
            os.kill(os.getpid(), signal.SIGINT)
        return ScriptedBackend(plan, stages(plan))

    def __call__(self, *words: str, report: str = "report") -> tuple[int, str]:
        self.driven.clear()
        self.report = report
        stdout, stderr = StringIO(), StringIO()
        code = main(["search", "--isolation", "host", "--report", report, *words], stdout, stderr)
        assert "Traceback" not in stdout.getvalue() + stderr.getvalue()
        return code, stdout.getvalue() + stderr.getvalue()


def result(report: str = "report") -> dict[str, Any]:
    return dict(json.loads(Path(report, "search", "example", "search.json").read_text()))


@pytest.fixture
def search(tmp_path: Path) -> Iterator[Search]:
    made = Search()
    with scripted_commands(tmp_path, SPEC, made.backend):
        yield made


def test_the_result_is_that_of_the_values_driven(search: Search) -> None:
    code, out = search("example", "--runs", "32")
    found = result()
    assert code == 1
    assert found["judged"] + found["errors"] + found["proposed"] == 32
    assert (found["proposed"], found["nominal"]["outcome"]) == (2, "passed")
    assert found["rate"] == found["failed"] / found["judged"]
    assert found["low"] < 3 / 14 < found["high"]
    assert found["errors"] in range(2, 7)
    assert [(one["name"], abs(one["correlation"]) > 0.9) for one in found["influences"]] == [
        ("start", True),
        ("clutter", False),
    ]
    assert found["worst"]["margin"] < 0
    assert {failure["kind"] for failure in found["failures"]} == {
        f"hit wall {side} after # m" for side in ("left", "right")
    }
    assert f"{found['failed']} of {found['judged']} drives failed" in out
    assert not list(Path("report").glob("**/*--run-0"))


def test_a_failure_is_shrunk_to_a_test_of_its_own(search: Search) -> None:
    _, out = search("example", "--runs", "16", "--save")
    (shrunk,) = result()["shrunk"]
    start = float(shrunk["values"]["start"].removesuffix(" cm")) / 100
    assert (shrunk["changed"], shrunk["values"]["clutter"]) == (["start"], "0")
    assert (shrunk["failed"], shrunk["repeats"]) == (3, 3)
    assert LIMIT < start < LIMIT + 0.001
    assert shrunk["spec"] == "example-fails-at-start"
    assert "reducing: hit wall" in out
    assert f"as a test: {shrunk['spec']}" in out
    assert not Path("report/search/example/shrinking").exists()
    assert main(["compile", "--check", shrunk["spec"]], stdout := StringIO(), StringIO()) == 0, stdout.getvalue()
    checked = selection.select([shrunk["spec"]], (), [])
    (plan,) = compiler.plan(checked, Path("out")).compiled.suite.plans
    assert (start_of(plan), plan.clock) == (pytest.approx(start), "lockstep")
    assert f"hit wall right after {start:.3f} m" in checked.tests[0].spec.description
    driven = len(search.driven)
    search("example", "--runs", "16")
    assert (driven > 17, search.driven) == (True, [])


def test_it_ends_soon_after_the_first_failure(search: Search) -> None:
    code, out = search("example", "--runs", "24", "--until-failure")
    early = result()
    drives = early["judged"] + early["errors"] + early["proposed"]
    assert (code, early["ended_early"], drives % 8, drives < 24) == (1, True, 0, True)
    assert "a failure ended the search" in out and early["shrunk"]
    search("example", "--runs", "24", report="whole")
    first = min(one["worst"]["number"] for one in early["failures"])
    assert first > drives - 8 and not result("whole")["ended_early"]
    search("example", "--runs", "24")
    assert result() == result("whole"), "it goes on from there"


def test_a_drive_in_error_is_repeated_once(search: Search) -> None:
    search("example", "--runs", "16")
    twice = {slug for slug in search.driven if search.driven.count(slug) == 2}
    assert len(twice) == result()["errors"] > 0


@pytest.mark.thorough
def test_an_interrupted_search_goes_on_to_the_same_result(search: Search) -> None:
    words = ("example", "--runs", "16", "-j", "1")
    search(*words, report="whole")
    whole, before = set(search.driven), set[str]()
    for ends_at in (7, 11):
        search.ends_at = ends_at
        code, out = search(*words)
        assert (code, "the same command goes on" in out) == (130, True)
        assert len(before & set(search.driven)) <= 2, "one that was driven, and one that waited for its second try"
        before |= set(search.driven)
    search.ends_at = None
    assert search(*words)[0] == 1
    assert result() == result("whole")
    assert before | set(search.driven) == whole
    assert len(before & set(search.driven)) <= 1


@pytest.mark.thorough
def test_the_result_is_the_same_however_many_drive_at_once(search: Search) -> None:
    for jobs in ("1", "3"):
        search("example", "--runs", "16", "-j", jobs, report=jobs)
    assert result("1") == result("3")


def test_more_runs_continue_the_sweep(search: Search) -> None:
    search("example", "--runs", "4")
    search("example", "--runs", "9")
    assert {f"example--run-{number}" for number in range(5, 10)} <= set(search.driven)
    search("example", "--runs", "9", report="whole")
    assert result() == result("whole")


def test_a_round_on_the_host_has_no_more_drives_than_there_are_cids(search: Search) -> None:
    with Path("dodo.yml").open("a") as deployment:
        deployment.write("cids: 130-132\n")
    code, out = search("example", "--runs", "5", "-j", "1")
    assert code in (0, 1) and {f"example--run-{number}" for number in range(6)} <= set(search.driven), out


def test_another_seed_is_another_search(search: Search) -> None:
    search("example", "--runs", "1")
    code, out = search("example", "--runs", "1", "--seed", "1")
    assert (code, search.driven) == (2, [])
    assert "is of another test, application, range or seed" in out


def test_a_search_goes_on_in_another_folder(search: Search, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    search("example", "--runs", "1")
    shutil.copytree(tmp_path, tmp_path / "deeper" / "copy")
    monkeypatch.chdir(tmp_path / "deeper" / "copy")
    assert search("example", "--runs", "1")[0] == 1
    assert search.driven == []


def test_the_drive_at_the_nominal_values_decides_too(search: Search) -> None:
    examples.write(
        SPEC.replace("from: -8 cm, to: 8 cm, nominal: 0 cm", "from: -5 cm, to: 5.5 cm, nominal: 5.5 cm"), Path()
    )
    code, out = search("example", "--runs", "1")
    assert result()["failed"] == 0
    assert (code, "at the nominal values: failed" in out) == (1, True)


@pytest.mark.parametrize(
    ("address", "code", "said"),
    [
        ("", 2, "--storage is empty, expected the path of a file, or an address as postgresql://USER@HOST/DATABASE"),
        ("postgresql://u:geheim@h:port/db", 2, "the address after --storage cannot be read"),
        ("postgresql://u:geheim@127.0.0.1:1/db", 3, "'postgresql://u:***@127.0.0.1:1/db' cannot be used: "),
        ("/proc/search.journal", 3, "'/proc/search.journal' cannot be used: "),
    ],
)
def test_a_storage_that_cannot_be_used(search: Search, address: str, code: int, said: str) -> None:
    if address.startswith("postgresql"):
        pytest.importorskip("psycopg")
    found, out = search("example", "--storage", address)
    assert (found, search.driven, said in out, "geheim" in out) == (code, [], True, False), out


def test_an_address_in_a_wrong_place_shows_no_password(search: Search, capsys: pytest.CaptureFixture[str]) -> None:
    address = "postgresql://u:geheim@h/db"
    said = "".join(search(*words)[1] for words in ([address], ["example", address], ["example", "--runs", address]))
    assert "geheim" not in said + capsys.readouterr().err


def test_a_missing_driver_of_databases_is_said(search: Search, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    said = f"dodo search: --storage needs psycopg: {advice.install('storage')}\n"
    assert search("example", "--storage", "postgresql://u@h/db") == (2, said)


@pytest.mark.parametrize(
    ("more", "words", "said"),
    [
        ("", ("base",), "base has no ranges to search"),
        ("", ("nothing",), "unknown test 'nothing'"),
        ("matrix: {rate: [1 Hz, 2 Hz]}\nrecord: {frames: '${matrix.rate}'}\n", ("example",), "means 2 tests"),
        ("", ("example", "--runs", "0"), "'0' is not a whole number of at least 1"),
    ],
)
def test_what_cannot_be_searched(
    search: Search, capsys: pytest.CaptureFixture[str], more: str, words: tuple[str, ...], said: str
) -> None:
    path = Path(examples.EXAMPLE)
    path.write_text(path.read_text() + more)
    code, out = search(*words)
    assert (code, search.driven) == (2, [])
    assert said in out + capsys.readouterr().err


def test_containers_are_refused(search: Search) -> None:
    compose = Path("docker-compose.yml")
    compose.write_text(compose.read_text().replace("    x-dodo-process: [python, driver.py]\n", ""))
    code, out = search("example")
    assert (code, "'x-dodo-process'" in out) == (2, True)
