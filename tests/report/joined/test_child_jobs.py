"""Reports of the jobs of a child pipeline, from a server that answers as GitLab does."""

import io
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl.report import child_jobs
from dodo_dsl.report.child_jobs import NoChildJobs
from dodo_dsl.report.results import GivenReport
from tests.report.joined.gitlab_api import Api, serving
from tests.report.joined.reports import named, tree, write


@pytest.fixture
def api(tmp_path: Path) -> Iterator[Api]:
    for name in ("drive", "look"):
        write(tmp_path / "jobs" / name / "dodo-report", [named(name)])
        (tmp_path / "jobs" / name / "other.txt").write_text("not of the report")
    (tmp_path / "jobs" / "broken").mkdir()
    (tmp_path / "target").mkdir()
    with serving(tmp_path / "jobs") as served:
        yield served


def fetched(api: Api, folder: Path, **more: str) -> tuple[list[GivenReport], list[str]]:
    return child_jobs.fetch(child_jobs.of_job(api.environment(**more)), folder)


def test_the_reports_of_all_jobs_are_fetched(api: Api, tmp_path: Path) -> None:
    found, sentences = fetched(api, tmp_path / "target")
    assert sentences == ["job 'broken' has no report"]
    for name, place in zip(("drive", "look"), (report.folder for report in found), strict=True):
        assert tree(place) == tree(tmp_path / "jobs" / name / "dodo-report")
        assert [each.name for each in place.parent.iterdir()] == ["dodo-report"]
    assert {*api.tokens} == {("secret", None)}


def test_a_token_of_one_s_own_comes_first(api: Api, tmp_path: Path) -> None:
    fetched(api, tmp_path / "target", DODO_API_TOKEN="mine")
    assert {*api.tokens} == {(None, "mine")}


def test_a_refused_token_is_said(api: Api, tmp_path: Path) -> None:
    api.refused = "bridges"
    with pytest.raises(NoChildJobs) as caught:
        fetched(api, tmp_path / "target")
    assert str(caught.value) == (
        "GitLab answers '401 Unauthorized' to pipelines/7/bridges?per_page=100&page=1; "
        "set DODO_API_TOKEN to a token of scope read_api"
    )


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        ("CI_PIPELINE_ID", "", "CI_PIPELINE_ID is not set; --gitlab is for jobs of GitLab"),
        ("CI_JOB_TOKEN", "", "CI_JOB_TOKEN is not set; --gitlab is for jobs of GitLab"),
        ("CI_API_V4_URL", "file:///etc", "CI_API_V4_URL is 'file:///etc', expected a URL"),
    ],
)
def test_elsewhere_there_is_no_pipeline(variable: str, value: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(NoChildJobs) as caught:
        child_jobs.of_job({**Api(tmp_path).environment(), "CI_API_V4_URL": "https://x/api", variable: value})
    assert str(caught.value) == said


@pytest.mark.parametrize("answer", [b"", b'{"message": 1}', b"[3]", b'[{"downstream_pipeline": {"id": "../x"}}]'])
def test_an_answer_that_is_no_list_of_jobs_is_said(api: Api, tmp_path: Path, answer: bytes) -> None:
    api.changed["bridges"] = answer
    with pytest.raises(NoChildJobs, match=r"GitLab's answer lists no jobs"):
        fetched(api, tmp_path / "target")


def test_an_archive_writes_only_into_its_report(api: Api, tmp_path: Path) -> None:
    """Whatever it names, and whatever it calls a link."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        link = zipfile.ZipInfo("dodo-report/link")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(link, "/etc/passwd")
        for name in ("/tmp/absolute", "dodo-report/../../above", "../beside", "elsewhere/file"):
            archive.writestr(name, "x")
    api.changed["jobs/3/artifacts"] = buffer.getvalue()
    before = set(tmp_path.rglob("*"))
    reports, sentences = fetched(api, tmp_path / "target")
    assert len(reports) == 1 and sentences[1] == "job 'look' is left out: there is no dodo-report/results.json"
    written = {path for path in {*tmp_path.rglob("*")} - before if path.is_relative_to(tmp_path / "target" / "3")}
    assert {path.name for path in written} == {"3", "dodo-report", "link", "above"}
    assert not (tmp_path / "target" / "3" / "dodo-report" / "link").is_symlink()


def archive(name: str = "dodo-report/results.json") -> bytes:
    """A compressed report, with a file of another name."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as opened:
        opened.writestr(name, bytes(range(256)) * 40)
    return buffer.getvalue()


EXPECTED = "expected a zip archive with dodo-report/results.json"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"not a zip", f"its artifacts, job 3, cannot be read (File is not a zip file), {EXPECTED}"),
        (archive()[:-30], EXPECTED),
        (archive(), "dodo-report/results.json: not results of DoDo ("),
        (archive("dodo-report/test.rec"), "there is no dodo-report/results.json"),
        (archive("elsewhere/"), "job 'look' has no report"),
    ],
    ids=["no zip", "truncated", "other results", "no results", "no report"],
)  # fmt: skip
def test_a_job_without_a_whole_report_is_named_and_the_others_are_drawn(
    data: bytes, said: str, api: Api, tmp_path: Path
) -> None:
    api.changed["jobs/3/artifacts"] = data
    reports, sentences = fetched(api, tmp_path / "target")
    assert [outcome.slug for report in reports for outcome in report.outcomes] == ["drive"]
    assert len(sentences) == 2 and sentences[1].startswith("job 'look' ") and said in sentences[1]


def test_what_is_too_large_or_refused_is_left_out(api: Api, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child_jobs, "_MOST_BYTES", 100)
    api.refused = "jobs/2/artifacts"
    said = fetched(api, tmp_path / "target")[1]
    assert said[1:] == [
        "job 'drive' is left out: GitLab answers '401 Unauthorized' to jobs/2/artifacts; "
        "set DODO_API_TOKEN to a token of scope read_api",
        "job 'look' is left out: the artifacts are larger than a report may be",
    ]
