"""``dodo run --watch``: which tests run again after a file was saved, with scripted backends."""

import argparse
import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli import run, watch
from dodo_dsl.cli.main import parser
from dodo_dsl.cli.watch import Watch, saved, seen
from dodo_dsl.plan.model import Plan
from dodo_dsl.report import results
from dodo_dsl.run.protocol import Exited, Ready, VerdictEvent
from dodo_dsl.run.work_folder import work_folder
from tests.run.scripted import FAILED, PASSED, ScriptedBackend, ScriptedBackends

ROOT = Path(__file__).parents[3]


@dataclass
class Desk:
    """A deployment with two tests and an application, and the watch of them; ``verdict`` is that of each test."""

    folder: Path
    verdict: VerdictEvent = PASSED
    began: list[str] = field(default_factory=list)
    stdout: StringIO = field(default_factory=StringIO)
    watch: Watch = field(init=False)

    def backend(self, tested: Plan, _: int) -> ScriptedBackend:
        self.began.append(tested.slug)
        stages = {layer: [(0.0, Ready(s.name)) for s in tested.layer(layer)] for layer in ("environment", "action")}
        stages["evaluation"] = [(0.0, Ready("track"))]
        return ScriptedBackend(tested, {**stages, "begin": [(0.0, self.verdict), (0.0, Exited("track", 0))]})

    def spec(self, name: str) -> Path:
        return self.folder / "tests" / name / f"{name}.dodo.yml"

    def save(self, path: Path, old: str = "", new: str = "# changed\n") -> list[str]:
        """What the watch runs after a text of a file was replaced."""
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1) if old else text + new)
        self.began.clear()
        self.stdout.truncate(self.stdout.seek(0))
        assert self.watch.run({path.resolve()}) is False
        return sorted(self.began)


def options(*words: str) -> argparse.Namespace:
    return parser().parse_args(["run", *words])


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / ".leases"))
    monkeypatch.setenv("DODO_HISTORY", str(tmp_path / ".history.jsonl"))
    for name in ("maps", "sil-closed-straight", "sil-closed-left-curve"):
        shutil.copytree(ROOT / "tests_registry" / name, tmp_path / "tests" / name)
    shutil.copytree(ROOT / "examples/kiwi", tmp_path / "kiwi", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: kiwi/docker-compose.yml\n")
    made = Desk(tmp_path)
    monkeypatch.setattr(run, "CombinedBackends", lambda *_: ScriptedBackends(made.backend))
    given = options("--watch", "--clock", "lockstep", "--isolation", "host", "--report", "report")
    with work_folder() as folder:
        made.watch = Watch(given, folder, made.stdout)
        yield made


@pytest.fixture
def running(desk: Desk) -> Desk:
    """Both tests have run."""
    assert desk.watch.run(None) is False
    assert sorted(desk.began) == BOTH
    return desk


BOTH = ["sil-closed-left-curve", "sil-closed-straight"]


@pytest.mark.slow
def test_all_run_at_first_and_then_what_a_file_affects(running: Desk) -> None:
    assert running.save(running.spec(BOTH[1]), "max-time: 4", "max-time: 3") == [BOTH[1]]
    assert "saved: tests/sil-closed-straight/sil-closed-straight.dodo.yml\n" in running.stdout.getvalue()
    assert "compared with the run before: " in running.stdout.getvalue()
    assert running.save(running.spec(BOTH[1])) == []
    assert running.stdout.getvalue().startswith("no test is affected by tests/sil-closed-straight/")
    assert running.save(next((running.folder / "tests" / "maps" / "straight").glob("*.obj"))) == [BOTH[1]]
    assert running.save(running.folder / "kiwi" / "steering.py") == BOTH
    assert [outcome.slug for outcome in results.load(running.folder / "report" / "results.json")] == BOTH


@pytest.mark.slow
def test_the_report_keeps_the_tests_that_did_not_run_again(running: Desk) -> None:
    running.verdict = FAILED
    running.save(running.spec(BOTH[1]), "max-time: 4", "max-time: 3")
    outcomes = results.load(running.folder / "report" / "results.json")
    assert {outcome.slug: outcome.outcome for outcome in outcomes} == {BOTH[0]: "passed", BOTH[1]: "failed"}
    assert "NEWLY FAILING" in running.stdout.getvalue()


@pytest.mark.slow
def test_what_was_saved_while_a_spec_was_wrong_counts_once_it_is_right(running: Desk) -> None:
    assert running.save(running.spec(BOTH[0]), "level: sil", "level: sli") == []
    assert "the tests above cannot be compiled" in running.stdout.getvalue()
    assert running.save(running.folder / "kiwi" / "steering.py") == []
    assert running.save(running.spec(BOTH[0]), "level: sli", "level: sil") == BOTH


def test_it_waits_until_nothing_changes_any_more(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    before = desk.watch.look()
    looks = iter([before, {**before, Path("a"): (1, 1)}, {**before, Path("a"): (2, 5)}, {**before, Path("a"): (2, 5)}])
    monkeypatch.setattr(watch, "LOOK_S", 0.0)
    monkeypatch.setattr(desk.watch, "look", lambda: next(looks))
    files, changed = desk.watch.wait(before)
    assert (changed, files[Path("a")], list(looks)) == ({Path("a")}, (2, 5), [])


def test_it_looks_at_specs_maps_and_the_application_and_not_at_its_report(desk: Desk) -> None:
    found = desk.watch.look()
    assert {desk.spec(BOTH[0]).resolve(), (desk.folder / "kiwi/steering.py").resolve()} <= found.keys()
    assert not [path for path in found if path.is_relative_to(desk.folder / "report")]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("a.py", "tests/b.yml", "report/c.json", ".git/d", "__pycache__/e.pyc", "f.py~", "tests/.g.swp"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("text")
    return tmp_path


def names(folder: Path, paths: "set[Path] | dict[Path, tuple[int, int]]") -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in paths)


def test_hidden_files_and_outputs_are_left_out(folder: Path) -> None:
    assert names(folder, seen([folder], {folder / "report"})) == ["a.py", "tests/b.yml"]


def test_what_is_written_replaced_made_or_removed_is_saved(folder: Path) -> None:
    before = seen([folder], ())
    assert saved(before, seen([folder], ())) == set()
    os.utime(folder / "a.py", ns=(1, 1))
    (folder / "tests" / "b.yml").unlink()
    (folder / "tests" / "new.yml").write_text("text")
    assert names(folder, saved(before, seen([folder], ()))) == ["a.py", "tests/b.yml", "tests/new.yml"]


def test_links_lead_into_no_other_folder_and_a_missing_folder_is_empty(folder: Path) -> None:
    (folder / "tests" / "up").symlink_to(folder)
    (folder / "dangling").symlink_to("nowhere")
    assert names(folder, seen([folder / "tests", folder / "nowhere"], ())) == ["tests/b.yml"]
