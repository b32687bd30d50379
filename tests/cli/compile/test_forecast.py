"""``dodo compile --forecast``."""

import json
import sys
from pathlib import Path

import pytest
import yaml

from dodo_dsl.cli.main import main

ROOT = Path(__file__).parents[3]
STRAIGHT = "sil-closed-straight"


@pytest.fixture(autouse=True)
def in_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def results(folder: Path, **took: float) -> Path:
    tests = [
        {
            "name": slug, "slug": slug, "spec": "a.dodo.yml", "level": "sil", "kind": "closed-loop",
            "outcome": "passed", "reason": "", "setup_s": 1.0, "execution_s": seconds - 1.0, "sim_s": None, "cid": 130,
            "seed": 1, "clock": "lockstep", "backend": "process", "services": [], "checks": [],
        }
        for slug, seconds in took.items()
    ]  # fmt: skip
    folder.mkdir()
    (folder / "results.json").write_text(json.dumps({"dodo": "results", "version": 1, "tests": tests}))
    return folder


def forecast(tmp_path: Path, capsys: pytest.CaptureFixture[str], *words: str | Path, code: int = 0) -> str:
    command = ["compile", STRAIGHT, "sil-open-straight", "-o", str(tmp_path / "out"), "--forecast", *map(str, words)]
    assert main(command, sys.stdout, sys.stderr) == code
    said = capsys.readouterr()
    return said.err if code else said.out.partition("\n")[2]


@pytest.mark.thorough
def test_times_of_reports_are_taken(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = results(tmp_path / "one", **{STRAIGHT: 99.0})
    two = results(tmp_path / "two", **{STRAIGHT: 50.0, "sil-open-straight": 25.0})
    times = ("--times", one, "--times", two / "results.json", "--overhead", "5")
    assert forecast(tmp_path, capsys, "1", *times) == (
        "forecast with 1 runner: about 1 min 25 s"
        " (1 min 25 s of work, 5 s a job before its test, sil-open-straight ends last)\n"
    )
    assert forecast(tmp_path, capsys, "2", *times).startswith("forecast with 2 runners: about 55 s (")


@pytest.mark.thorough
def test_a_test_without_a_time_may_take_its_timeout(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line, note = forecast(tmp_path, capsys, "1").splitlines()
    assert line.startswith("forecast with 1 runner: at most ")
    assert note.startswith("note: sil-closed-straight and 1 more never ran here, and may take the whole timeout")


@pytest.mark.thorough
def test_what_has_no_times_is_refused_and_nothing_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "there is no " in forecast(tmp_path, capsys, "1", "--times", tmp_path / "gone.json", code=2)
    assert "--check does not write" in forecast(tmp_path, capsys, "1", "--check", code=2)
    assert not (tmp_path / "out").exists()


@pytest.mark.thorough
def test_tests_share_jobs_by_their_times(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    times = results(tmp_path / "times", **{STRAIGHT: 99.0, "sil-open-straight": 60.0, "sil-open-left-curve": 30.0})
    words = [*times_of(times), "-o", str(tmp_path / "out"), "--jobs", "2"]
    command = ["compile", STRAIGHT, "sil-open-straight", "sil-open-left-curve", *words]
    assert main(command, sys.stdout, sys.stderr) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "packed into 2 jobs, about 1 min 39 s in 'sil-closed-straight'"
    made = yaml.safe_load((tmp_path / "out/child.gitlab-ci.yml").read_text())
    assert "sil-open-left-curve --compiled" in made["tests 2/2"]["script"][0]
    assert main([*command, "--check"], sys.stdout, sys.stderr) == 0, "nothing is stale"
    assert main([*command, "--forecast", "2"], sys.stdout, sys.stderr) == 0
    assert "forecast with 2 runners: about 1 min 49 s (" in capsys.readouterr().out
    assert main([*command[:4], *words[2:]], sys.stdout, sys.stderr) == 0
    said = capsys.readouterr().out.splitlines()[-2:]
    assert said[0].startswith("packed into 2 jobs, at most ") and "and 2 more never ran here" in said[1]


def times_of(folder: Path) -> list[str]:
    return ["--times", str(folder)]
