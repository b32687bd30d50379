"""How long tests took, over runs: what is kept, what is damaged, and what cannot be written."""

import json
import os
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.outcome import Outcome
from dodo_dsl.run import history
from dodo_dsl.run.history import History, typical_s
from dodo_dsl.run.outcomes import error_outcome
from tests.run.scripted import plan

KEY = ("a/a.dodo.yml", "a", "process", "realtime")


@pytest.fixture(autouse=True)
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DODO_HISTORY", str(tmp_path / "state" / "history.jsonl"))
    return tmp_path / "state" / "history.jsonl"


def took(seconds: float, slug: str = "a") -> tuple[str, Outcome]:
    """A test of a name that passed."""
    outcome = error_outcome(plan(slug), "process", "it drove")
    return slug, replace(outcome, outcome="passed", setup_s=1.0, execution_s=seconds - 1)


def test_what_was_added_is_kept(path: Path) -> None:
    added, error = History(), ("b", replace(took(3.0, "b")[1], outcome="error"))
    added.add([took(3.0), error, ("c", error_outcome(plan("c"), "process", "no engine"))])
    added.add([took(900.0)])
    found = History().of(*KEY)
    assert [typical_s(found), typical_s(found[:1]), typical_s([])] == [451.5, 3.0, None]
    assert found == added.of(*KEY)
    assert found[0].in_words().startswith("passed after 3.0 s, 20")
    for other in (("b/b.dodo.yml", "b", *KEY[2:]), (*KEY[:2], "docker", KEY[3]), (*KEY[:3], "lockstep")):
        assert History().of(*other) == []


def test_a_test_of_another_repository_is_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its address, wherever it is cloned, or else by the folder of its dodo.yml."""
    for name, address in (("one", ""), ("other", ""), ("clone", "git@x:a/b.git"), ("again", "git@x:a/b.git")):
        (tmp_path / name / "below").mkdir(parents=True)
        (tmp_path / name / "dodo.yml").write_text("dodo: 1\n")
        if address:
            subprocess.run(["git", "init", "-q", tmp_path / name], check=True)
            subprocess.run(["git", "-C", tmp_path / name, "remote", "add", "origin", address], check=True)
    for name, known in (("one", 0), ("other", 0), ("one/below", 1), ("clone", 0), ("again/below", 1)):
        monkeypatch.chdir(tmp_path / name)
        found = History()
        assert len(found.of(*KEY)) == known, name
        found.add([took(3.0)])


def test_a_long_history_with_lines_that_no_run_wrote_is_shortened(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    History().add([took(3.0)])
    (line,) = path.read_text().splitlines()
    damaged = (json.dumps({**json.loads(line), "setup_s": -1}), "[" * 100_000, '{"when": 1, "spec"', "3", "\xff")
    path.write_text("\n".join([*damaged, *[line] * 95, ""]))
    assert len(History().of(*KEY)) == 95
    monkeypatch.setattr(history, "_MAX_BYTES", 10_000)
    History().add([took(3.0)])
    assert len(History().of(*KEY)) == 51
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("kind", ["none", "link", "fifo"])
def test_what_is_no_file_of_this_user_is_left_alone(path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path.parent.mkdir()
    (victim := path.with_name("victim")).write_text("")
    if kind == "none":
        for name in ("HOME", "DODO_HISTORY", "XDG_STATE_HOME"):
            monkeypatch.delenv(name, raising=False)
        monkeypatch.setattr("os.getuid", lambda: 3_999_999_999)
    path.symlink_to(victim) if kind == "link" else os.mkfifo(path)
    History().add([took(1.0)])
    assert (History().of(*KEY), victim.read_text()) == ([], "")
