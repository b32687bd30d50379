"""``dodo report`` from its command line to its exit code."""

from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.report import results
from tests.report.joined.gitlab_api import serving
from tests.report.joined.reports import named, tree, write


def report(*words: object) -> tuple[int, str, str]:
    stdout, stderr = StringIO(), StringIO()
    return main(["report", *map(str, words)], stdout, stderr), stdout.getvalue(), stderr.getvalue()


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_one_report_is_drawn_again_where_it_is(here: Path) -> None:
    write(here / "dodo-report", [named("a", outcome="failed")])
    before = tree(here)
    for name in ("index.html", "junit.xml", "metrics.txt"):
        (here / "dodo-report" / name).unlink()
    for words in ([], ["dodo-report"], ["dodo-report/results.json"]):
        assert report(*words) == (0, "report: dodo-report/index.html\n", "")
        assert tree(here) == before


def test_several_reports_are_joined(here: Path) -> None:
    for number in (1, 2):
        write(here / f"job-{number}", [named("a"), named(f"b-{number}")])
    code, said, _ = report("job-1", "job-2/results.json", "-o", "out")
    assert (code, said) == (
        0,
        "'a' of job-2/results.json is called 'a--report-2', as there is one before it\nreport: out/index.html\n",
    )
    assert [o.slug for o in results.load(here / "out" / "results.json")] == ["a", "b-1", "a--report-2", "b-2"]


def test_what_cannot_be_joined_is_a_sentence(here: Path) -> None:
    write(here / "job", [named("a")])
    (here / "job" / "results.json").rename(here / "main.json")
    (here / "broken").mkdir()
    (here / "broken" / "results.json").write_text("{}")
    (here / "full").mkdir()
    (here / "full" / "file").touch()
    for words, said in (
        (["main.json", "job", "-o", "out"], "there is no job/results.json"),
        (["main.json", "no.json", "-o", "out"], "there is no no.json"),
        (["main.json", "broken", "-o", "out"], "broken/results.json: not results of DoDo "
             "(Object missing required field `dodo`)"),
        (["main.json", "main.json"], "2 reports are given; name the folder to join them into with -o"),
        (["main.json"], "'main.json' is not called results.json; name a folder for the report with -o"),
        (["main.json", "-o", "full"],
         "full: neither a new or empty folder nor a report of DoDo; nothing is replaced"),
    ):  # fmt: skip
        assert report(*words) == (2, "", f"dodo report: {said}\n")
    assert not (here / "out").exists()


@pytest.mark.parametrize(("outcome", "code"), [("passed", 0), ("failed", 1), ("error", 3)])
@pytest.mark.thorough
def test_what_changed_decides_as_the_run_did(here: Path, outcome: str, code: int) -> None:
    write(here / "main", [named("a"), named("b")])
    write(here / "new", [named("a"), named("b", outcome=outcome, reason="hit wall")])
    told = "1 newly failing, 1 still passing" if code else "2 still passing"
    for words in (["new"], ["new", "-o", "out"]):
        assert report(*words, "--against", "main")[0] == code
        for other in ("main", "main/results.json"):
            ended, said, _ = report(*words, "--against", other)
            assert (ended, said.splitlines()[0]) == (code, f"compared with main/results.json: {told}")
        folder = here / words[-1]
        assert f"{told}, compared with main/results.json" in (folder / "index.html").read_text()
        assert report(words[-1])[0] == 0
        assert "compared with" not in (folder / "index.html").read_text()


def test_a_missing_report_to_compare_with_changes_nothing(here: Path) -> None:
    write(here / "new", [named("a")])
    before = tree(here)
    assert report("new", "-o", "out", "--against", "main") == (2, "", "dodo report: there is no main/results.json\n")
    assert tree(here) == before


def test_the_reports_of_a_child_pipeline_are_joined(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(here / "jobs" / "a" / "dodo-report", [named("a", outcome="failed")])
    write(here / "jobs" / "b" / "dodo-report", [named("b")])
    (here / "jobs" / "c").mkdir()
    with serving(here / "jobs") as api:
        for name, value in api.environment(CI_JOB_URL="https://git.example/-/jobs/5").items():
            monkeypatch.setenv(name, value)
        assert report("--gitlab") == (0, "job 'c' has no report\nreport: dodo-report/index.html\n", "")
    assert [o.slug for o in results.load(here / "dodo-report" / "results.json")] == ["a", "b"]
    junit = (here / "dodo-report" / "junit.xml").read_text()
    assert "[[ATTACHMENT|dodo-report/a/trajectory.png]]" in junit
    assert junit.count("replay: https://git.example/-/jobs/5/artifacts/file/dodo-report/a/drive.html") == 1


def test_outside_gitlab_there_are_no_child_pipelines(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("CI_API_V4_URL", "CI_PROJECT_ID", "CI_PIPELINE_ID"):
        monkeypatch.delenv(name, raising=False)
    assert report("--gitlab")[::2] == (2, "dodo report: CI_API_V4_URL is not set; --gitlab is for jobs of GitLab\n")
