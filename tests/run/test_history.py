"""How long tests took, over runs: what is kept, what is damaged, and what cannot be written."""

import json
import math
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Literal

import pytest

from dodo_dsl.outcome import Outcome
from dodo_dsl.run import history
from dodo_dsl.run.history import History
from dodo_dsl.run.outcomes import error_outcome
from tests.run.scripted import plan

LINE = {
    "when": 1, "spec": "s", "test": "t", "level": "sil", "backend": "process", "clock": "realtime",
    "outcome": "passed", "setup_s": 1.0, "execution_s": 2.0, "repository": history._repository(),
}  # fmt: skip


NEVER_BEGAN = error_outcome(plan("c"), "process", "no engine")


def took(setup_s: float, execution_s: float, slug: str = "a") -> tuple[str, Outcome]:
    """A test of a name that passed."""
    outcome = error_outcome(plan(slug), "process", "it drove")
    return slug, replace(outcome, outcome="passed", setup_s=setup_s, execution_s=execution_s)


def test_what_was_added_is_kept_once_it_is_saved(tmp_path: Path) -> None:
    path = tmp_path / "state" / "history.jsonl"
    added = History(path, lambda: 4711.5)
    added.add([took(1.0, 2.0), ("b", replace(took(1.0, 2.0, "b")[1], outcome="error")), ("c", NEVER_BEGAN)])
    assert not path.exists()
    added.save()
    added.add([took(3.0, 4.0)])
    added.save()
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [(line["test"], line["when"], line["setup_s"]) for line in lines] == [("a", 4711, 1.0), ("a", 4711, 3.0)]
    found = History(path)
    assert found.seconds("a/a.dodo.yml", "a", "process", "realtime") == 5.0
    assert found.seconds("b/b.dodo.yml", "b", "process", "realtime") is None, "an error says nothing about the time"
    assert found.seconds("a/a.dodo.yml", "a", "docker", "realtime") is None
    assert found.seconds("a/a.dodo.yml", "a", "process", "lockstep") is None


def test_the_forecast_is_the_median_of_the_latest_runs(tmp_path: Path) -> None:
    found = History(tmp_path / "none")
    found.add([took(0.0, seconds) for seconds in (900.0, 1.0, 2.0, 30.0, 4.0, 5.0)])
    assert found.seconds("a/a.dodo.yml", "a", "process", "realtime") == 4.0


def test_a_test_of_another_repository_is_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its address, wherever it is cloned, or else by the folder of its dodo.yml."""
    for name, address in (("one", ""), ("other", ""), ("clone", "git@x:a/b.git"), ("again", "git@x:a/b.git")):
        (tmp_path / name / "below").mkdir(parents=True)
        (tmp_path / name / "dodo.yml").write_text("dodo: 1\n")
        if address:
            subprocess.run(["git", "init", "-q", tmp_path / name], check=True)
            subprocess.run(["git", "-C", tmp_path / name, "remote", "add", "origin", address], check=True)
    for name, known in (("one", None), ("other", None), ("one/below", 3.0), ("clone", None), ("again/below", 3.0)):
        monkeypatch.chdir(tmp_path / name)
        found = History(tmp_path / "history.jsonl")
        assert found.seconds("a/a.dodo.yml", "a", "process", "realtime") == known, name
        found.add([took(1.0, 2.0)])
        found.save()


@pytest.mark.parametrize(
    "change",
    [
        *({"spec": ["s"]}, {"setup_s": math.inf}, {"setup_s": math.nan}, {"execution_s": -1}, {"execution_s": "x"}),
        *({"checks": checks} for checks in (3, {"a": "x"}, {"a": math.inf}, [1.0], None)),
    ],
)
def test_lines_that_no_run_wrote_are_skipped(tmp_path: Path, change: dict[str, object]) -> None:
    path = tmp_path / "history.jsonl"
    lines = (json.dumps(LINE), json.dumps({**LINE, **change}), "[" * 100_000, '{"when": 1, "spec"', "3", "null")
    path.write_text("".join(f"{line}\n" for line in lines))
    assert [(run.test, run.setup_s) for run in History(path).runs] == [("t", 1.0)]


def test_a_long_history_with_bytes_that_are_not_utf_8_is_shortened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(history, "_MAX_BYTES", 10_000)
    path = tmp_path / "history.jsonl"
    path.write_bytes((json.dumps(LINE).encode() + b"\n") * 99 + b"\xff\xfe\n")
    found = History(path)
    found.add([took(1.0, 2.0)])
    found.save()
    assert len(path.read_bytes().splitlines()) == 51
    assert len(History(path).runs) == 50
    assert [entry.name for entry in tmp_path.iterdir()] == ["history.jsonl"]


def test_a_user_without_a_home_folder_has_no_history(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("HOME", "DODO_HISTORY", "XDG_STATE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.getuid", lambda: 3_999_999_999)
    found = History()
    found.add([took(1.0, 2.0)])
    found.save()
    assert History().runs == []


def test_the_values_of_checks_in_the_latest_runs(tmp_path: Path) -> None:
    path = tmp_path / "history.jsonl"
    path.write_text(json.dumps(LINE) + "\n")
    found = History(path, lambda: 7.0)

    def measured(value: float | None, outcome: Literal["passed", "error"] = "passed") -> tuple[str, Outcome]:
        values = {"margin": value, "twice": 1.0, "none": None}
        checks = [{"name": name, "value": each} for name, each in (*values.items(), ("twice", 2.0))]
        return "a", replace(took(1.0, 2.0)[1], checks=tuple(checks), outcome=outcome)

    found.add([measured(float(n)) for n in range(30)] + [measured(99.0, "error"), measured(None)])
    found.save()
    key = ("a/a.dodo.yml", "a", "process", "realtime")
    runs = History(path).checks(*key)
    assert runs == found.checks(*key)
    assert runs == [{"when": 7, "outcome": "passed", "checks": {"margin": float(n)}} for n in range(10, 30)]
    assert History(path).checks("s", "t", "process", "realtime") == []
