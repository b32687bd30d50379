"""Reports of the jobs of a child pipeline, from a server that answers as GitLab does."""

import io
import stat
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dodo_dsl.report import child_jobs, results
from dodo_dsl.report.child_jobs import NoChildJobs
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


def fetched(api: Api, folder: Path, **more: str) -> dict[str, Path | None]:
    return dict(child_jobs.fetch(child_jobs.of_job(api.environment(**more)), folder))


def test_the_reports_of_all_jobs_are_fetched(api: Api, tmp_path: Path) -> None:
    found = fetched(api, tmp_path / "target")
    assert list(found) == ["broken", "drive", "look"]
    assert found["broken"] is None
    for name in ("drive", "look"):
        place = found[name]
        assert place is not None and tree(place) == tree(tmp_path / "jobs" / name / "dodo-report")
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
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in ("/tmp/absolute", "dodo-report/../../above", "../beside", "elsewhere/file"):
            archive.writestr(name, "x")
        link = zipfile.ZipInfo("dodo-report/link")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(link, "/etc/passwd")
        archive.writestr("dodo-report/results.json", "[]")
    api.changed["artifacts"] = buffer.getvalue()
    found = fetched(api, tmp_path / "target")
    assert tree(tmp_path / "target") == {f"{n}/dodo-report/results.json": b"[]" for n in (2, 3)}
    assert results.FILE_NAME == "results.json" and len(found) == 3


def archive(change: Callable[[bytearray], None]) -> bytes:
    """A compressed report, changed."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as opened:
        opened.writestr("dodo-report/results.json", bytes(range(256)) * 40)
    data = bytearray(buffer.getvalue())
    change(data)
    return bytes(data)


def damage(data: bytearray) -> None:
    """In the compressed bytes, behind the entry's header of 30 bytes and its name."""
    begin = 30 + len("dodo-report/results.json")
    data[begin : begin + 8] = b"\xff" * 8


def encrypt(data: bytearray) -> None:
    """As the flag of the central directory says (APPNOTE, section 4.4.4)."""
    data[data.index(b"PK\x01\x02") + 8] |= 1
    data[6] |= 1


@pytest.mark.parametrize("data", [b"not a zip", archive(damage), archive(encrypt)], ids=["no", "damaged", "encrypted"])
def test_a_damaged_archive_is_said(data: bytes, api: Api, tmp_path: Path) -> None:
    api.changed["artifacts"] = data
    with pytest.raises(NoChildJobs, match="the artifacts of job 2 cannot be read"):
        fetched(api, tmp_path / "target")


def test_what_is_too_large_is_refused(api: Api, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child_jobs, "MOST_BYTES", 100)
    with pytest.raises(NoChildJobs, match="the artifacts are larger than a report may be"):
        fetched(api, tmp_path / "target")
