"""Joins reports of several jobs, also of strangers, and changes no other file."""

import json
import os
import re
from html import unescape
from pathlib import Path

import pytest

from dodo_dsl import atomic
from dodo_dsl.report import join as report_join
from dodo_dsl.report import results
from dodo_dsl.report.join import join
from dodo_dsl.report.report_folder import write_summaries
from tests.report.joined.reports import PASSED, drive, named, tree, write


def joined(out: Path, *folders: Path) -> list[str]:
    outcomes, sentences = join([results.read_given(folder) for folder in folders], out)
    write_summaries(out, outcomes)
    return sentences


@pytest.fixture
def jobs(tmp_path: Path) -> tuple[Path, Path]:
    """Two jobs that both ran ``b``."""
    first = write(tmp_path / "jobs" / "1", [named("a"), named("b", outcome="failed", reason="hit wall")])
    return first, write(tmp_path / "jobs" / "2", [named("b"), named("c[light=dark]")])


def test_all_tests_and_files_are_in_one_report(tmp_path: Path, jobs: tuple[Path, Path]) -> None:
    out = tmp_path / "out"
    (sentence,) = joined(out, *jobs)
    assert sentence == f"'b' of {jobs[1]}/results.json is called 'b--report-2', as there is one before it"
    outcomes = results.load(out / "results.json")
    assert [(o.name, o.outcome) for o in outcomes] == [
        ("a", "passed"),
        ("b", "failed"),
        ("b[report=2]", "passed"),
        ("c[light=dark]", "passed"),
    ]
    for name in ("test.rec", "trajectory.png", "logs/application.app.log", "attempts/1/logs/application.app.log"):
        assert (out / "b" / name).read_text() == "1 b"
        assert (out / "b--report-2" / name).read_text() == "2 b"
    assert (out / "junit.xml").read_text().count("<testcase ") == 4
    assert 'dodo_passed{test="b--report-2"} 1.0' in (out / "metrics.txt").read_text()
    assert json.loads((out / "b--report-2" / "drive.js").read_text()[15:-2])["test"]["name"] == "b[report=2]"


def links(page: Path) -> list[str]:
    found = re.findall(r'(?:href|src)="([^"#]+)"', page.read_text())
    return [unescape(link) for link in found if link != "data:,"]  # no icon


def test_every_link_leads_to_a_file_of_the_report(tmp_path: Path, jobs: tuple[Path, Path]) -> None:
    out = tmp_path / "out"
    joined(out, *jobs)
    index = links(out / "index.html")
    assert len(index) == 4 * 4 + 2  # page, recording, log, picture; and the cells of both with one name
    for page in (out / "index.html", *out.glob("*/drive.html")):
        for link in links(page):
            target = (page.parent / link).resolve()
            assert target.is_file() and target.is_relative_to(out.resolve()), (page, link)
    assert re.findall(r"ATTACHMENT\|(.*?)]]", (out / "junit.xml").read_text())[0].endswith("out/a/trajectory.png")


def test_a_report_is_replaced_and_files_of_others_stay(tmp_path: Path, jobs: tuple[Path, Path]) -> None:
    out = tmp_path / "out"
    joined(out, jobs[0])
    (out / "mine.txt").write_text("mine")
    (out / "a" / "mine.txt").write_text("mine")
    joined(out, jobs[1])
    assert sorted(path.name for path in out.iterdir()) == [
        "_viewer", "a", "b", "c--light-dark", "index.html", "junit.xml", "metrics.txt", "mine.txt", "results.json",
    ]  # fmt: skip
    assert [path.name for path in (out / "a").iterdir()] == ["mine.txt"]
    assert (out / "b" / "test.rec").read_text() == "2 b"


def test_nothing_else_is_replaced(tmp_path: Path, jobs: tuple[Path, Path]) -> None:
    full, report, link, loop = (tmp_path / name for name in ("full", "report", "link", "loop"))
    full.mkdir()
    (full / "thesis.tex").write_text("mine")
    joined(report, jobs[0])
    link.symlink_to(tmp_path / "new")
    joined(loop, jobs[0])
    (loop / "c--light-dark").symlink_to(tmp_path / "full")
    (tmp_path / "file").write_text("mine")
    before = tree(tmp_path)
    for out, why in (
        (full, "neither a new or empty folder nor a report"),
        (tmp_path / "file", "neither a new or empty folder nor a report"),
        (link, "a symlink"),
        (loop, "a symlink"),
        (jobs[1], "it holds a report that is to be joined"),
    ):
        with pytest.raises(atomic.NotReplaceable, match=why):
            joined(out, jobs[1])
    assert tree(tmp_path) == before


@pytest.mark.parametrize("slug", ["..", "../x", "a/b", "/tmp/x", "", "A", "_viewer", "a" * 241])
def test_no_slug_leaves_its_report(tmp_path: Path, slug: str) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "results.json").write_text(results.to_json([named("x", outcome="failed")]).replace('"x"', f'"{slug}"'))
    with pytest.raises(results.ResultsError, match=re.escape(f"{folder}/results.json: '{slug[:60]}' is not a slug")):
        joined(tmp_path / "out", folder)
    assert not (tmp_path / "out").exists()


def test_no_symlink_is_followed_and_no_other_file_is_taken(tmp_path: Path) -> None:
    folder = write(tmp_path / "in", [named("a"), named("b"), named("c")])
    (tmp_path / "secret").mkdir()
    (tmp_path / "secret" / "key.log").write_text("secret")
    for path in (folder / "a" / "test.rec", folder / "a" / "drive.js"):
        path.unlink()
        path.symlink_to(tmp_path / "secret" / "key.log")
    (folder / "a" / "logs" / "key.log").symlink_to(tmp_path / "secret" / "key.log")
    os.mkfifo(folder / "a" / "logs" / "fifo.log")
    (folder / "a" / "malware.exe").write_text("secret")
    (folder / "a" / "logs" / "x.html").write_text("secret")
    (folder / "b").rename(tmp_path / "elsewhere")
    (folder / "b").symlink_to(tmp_path / "elsewhere")
    (folder / "c" / "logs").rename(tmp_path / "logs")
    (folder / "c" / "logs").symlink_to(tmp_path / "secret")
    out = tmp_path / "out"
    sentences = joined(out, folder)
    assert sorted(sentence.removeprefix(f"{folder}/") for sentence in sentences) == [
        "a/drive.js is left out with its page: it is a symlink",
        "a/logs/fifo.log is left out: a FIFO, expected a file",
        "a/logs/key.log is left out: it is a symlink",
        "a/test.rec is left out: it is a symlink",
    ]
    assert not any(b"secret" in content for content in tree(out).values())
    assert not (out / "b").exists()
    assert {name for name in tree(out) if name.startswith("a/")} == {
        "a/trajectory.png",
        "a/logs/application.app.log",
        "a/logs/application.app.times",
        "a/attempts/1/logs/application.app.log",
    }


NO_DATA = [
    "alert(1);\n",
    "var dodoTest = {};\n",
    "var dodoTest = alert(1);\n",
    "var dodoTest = {}; alert(1);\n",
    "var dodoTest = NaN;\n",
    drive(PASSED).replace('"version":', '"x":1e999,"version":'),
    "var dodoTest = " + "[" * 100_000 + ";\n",
    drive(PASSED) + "alert(1);\n",
    drive(PASSED).replace('"version":', '"version":1'),
    drive(PASSED).replace("camera-0.mp4", "../../camera-0.mp4"),
    drive(PASSED).replace("drove", "dr\u00f6ve"),
    "\ud83d",
]


@pytest.mark.parametrize("text", NO_DATA, ids=range(len(NO_DATA)))
def test_a_script_that_is_no_data_is_left_out(tmp_path: Path, text: str) -> None:
    folder = write(tmp_path / "in", [PASSED])
    (folder / "test" / "drive.js").write_bytes(text.encode(errors="surrogatepass"))
    (folder / "test" / "drive.html").write_text("<script>alert(1)</script>")
    (sentence,) = joined(tmp_path / "out", folder)
    assert sentence.startswith(f"{folder}/test/drive.js is left out with its page: it ")
    assert not list((tmp_path / "out").rglob("drive.*"))
    assert not (tmp_path / "out" / "_viewer").exists()


def test_pages_are_those_of_this_dodo(tmp_path: Path) -> None:
    folder = write(tmp_path / "in", [PASSED])
    expected = tree(folder)
    (folder / "test" / "drive.html").write_text("<script>alert(1)</script>")
    (folder / "_viewer" / "main.js").write_text("alert(1)")
    assert joined(tmp_path / "out", folder) == []
    assert {**tree(tmp_path / "out"), "junit.xml": b""} == {**expected, "junit.xml": b""}


def test_results_alone_are_joined_without_files(tmp_path: Path) -> None:
    folder = write(tmp_path / "in", [PASSED])
    (folder / "results.json").rename(folder / "main.json")
    assert joined(tmp_path / "out", folder / "main.json") == []
    assert set(tree(tmp_path / "out")) == {"results.json", "index.html", "junit.xml", "metrics.txt"}


def test_the_same_slug_many_times(tmp_path: Path) -> None:
    outcomes = [named("a"), named("a"), named("a--report-2"), named("a")]
    folder = write(tmp_path / "in", outcomes)
    assert len(joined(tmp_path / "out", folder, folder)) == 6
    loaded = results.load(tmp_path / "out" / "results.json")
    assert len({outcome.slug for outcome in loaded}) == len({outcome.name for outcome in loaded}) == 8


def test_a_failed_join_leaves_the_earlier_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write(tmp_path / "in", [PASSED])
    out = tmp_path / "out"
    joined(out, folder)
    before = tree(tmp_path)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(report_join, "script", full)
    with pytest.raises(OSError, match="No space"):
        joined(out, folder)
    assert tree(tmp_path) == before
