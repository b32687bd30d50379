"""The report is written whatever services said, and its clean-up removes only what reports hold."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.outcome import Outcome, with_margin
from dodo_dsl.report import results
from dodo_dsl.report.files import SHARED, forget
from dodo_dsl.report.report_folder import draw_test, write_summaries
from dodo_dsl.report.viewer import page as viewer_page
from tests.report.joined.reports import draw
from tests.run.helpers import Bench

OUTCOME = Outcome(
    "test", "test", "t/t.dodo.yml", "sil", "closed-loop", "failed", "hit wall", 130, 0, "realtime", "process"
)


def recording(path: Path, *payloads: bytes) -> None:
    path.parent.mkdir(parents=True)
    path.write_bytes(b"".join(encode_frame(Envelope(1003, payload, 0, 0, n, 0)) for n, payload in enumerate(payloads)))


def frame(x: float) -> bytes:
    messages = MessageSet.standard()
    return messages.encode(messages.type("opendlv.sim.Frame")(x=x, qw=1.0))


@pytest.mark.parametrize("reason", ["cost $a_{ and $x", "<script>alert(1)</script>", "\x1b[31m\x00 \ufffe", "a\nb"])
def test_hostile_reasons_and_frames(tmp_path: Path, reason: str) -> None:
    recording(tmp_path / "report" / "test" / "test.rec", frame(0), b"\x0a\xff\xff\xff", frame(1), frame(float("nan")))
    outcome = replace(OUTCOME, reason=reason, last_lines=(reason,))
    tested = {"test": (Bench(tmp_path).plan(), tmp_path)}
    assert draw(tmp_path / "report", [outcome], tested) == []
    assert results.load(tmp_path / "report" / "results.json") == [outcome]
    assert (tmp_path / "report" / "test" / "trajectory.png").is_file()
    page = (tmp_path / "report" / "index.html").read_text()
    assert page.count("<script") == 1 and not set(page) & set("\x1b\x00\x07")
    assert (tmp_path / "report" / "junit.xml").is_file()


def test_a_snapshot_is_shown_beside_the_drive(tmp_path: Path) -> None:
    slugs = ("drive", "look", "nothing")
    recording(tmp_path / "drive" / "test.rec", frame(0), frame(1))
    (tmp_path / "look").mkdir()
    for slug in slugs[:2]:
        (tmp_path / slug / "snapshot.png").write_bytes(b"a picture")
    outcomes = [replace(OUTCOME, name=slug, slug=slug, level="hil") for slug in slugs]
    draw(tmp_path, outcomes, {"drive": (Bench(tmp_path).plan(), tmp_path)})
    page, junit = ((tmp_path / name).read_text() for name in ("index.html", "junit.xml"))
    assert re.findall(r'src="(.*?)"', page) == ["drive/trajectory.png", "drive/snapshot.png", "look/snapshot.png"]
    assert [path.split("/", 1)[1] for path in re.findall(r"ATTACHMENT\|(.*?)]]", junit)] == [
        "drive/trajectory.png",
        "look/snapshot.png",
    ]


def test_each_test_has_a_page(tmp_path: Path) -> None:
    recording(tmp_path / "report" / "drive" / "test.rec", frame(0), frame(1))
    outcomes = [replace(OUTCOME, name=slug, slug=slug) for slug in ("drive", "error")]
    plan = Bench(tmp_path).plan()
    assert draw(tmp_path / "report", outcomes, dict.fromkeys(("drive", "error"), (plan, tmp_path))) == []
    page = (tmp_path / "report" / "index.html").read_text()
    assert re.findall(r'href="(.*?drive.html)"', page) == ["drive/drive.html", "error/drive.html"]
    forget(tmp_path / "report", ["drive", "error"])
    assert not list((tmp_path / "report").glob("*/drive.*"))


def test_the_page_leads_to_spec_and_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    report = tmp_path / "out" / "report"
    recording(report / "test" / "test.rec", frame(0), frame(1))
    checks = tuple({"name": name, "value": 2, "limit": {}, "unit": "", "ok": True} for name in ("late", "mean"))
    checks = (*checks, with_margin({"name": "lag", "value": 0.5, "limit": {"max": 0.75}, "unit": "s", "ok": True}))
    outcome = replace(OUTCOME, description="Drive & turn.", checks=checks)
    other = replace(OUTCOME, name="other", slug="other", spec="t/gone.dodo.yml")
    spec = tmp_path / "t" / "t.dodo.yml"
    spec.parent.mkdir()
    spec.touch()
    write_summaries(report, [outcome, other])
    page = (report / "index.html").read_text()
    assert "<p>Drive &amp; turn.</p>" in page
    assert re.findall(r'href="([^"#]*)"', page) == ["data:,", "../../t/t.dodo.yml", "test/test.rec"]
    assert "<dt>Test</dt><dd>t/gone.dodo.yml</dd>" in page
    assert '<pre tabindex="0">ok   late: 2\nok   mean: 2\nok   lag: 0.5 s (at most 0.75 s)</pre>' in page


def test_forgetting_spares_what_is_not_a_report(tmp_path: Path) -> None:
    report = tmp_path / "project" / "report"
    for slug in ("test", "gone"):
        (report / slug / "logs").mkdir(parents=True)
        for name in ("test.rec", "snapshot.png"):
            (report / slug / name).write_bytes(b"")
    (report / "test" / "notes.txt").write_text("mine")
    (tmp_path / "project" / "logs").mkdir()
    document = json.loads(results.to_json([replace(OUTCOME, slug="gone")]))
    (report / "results.json").write_text(json.dumps(document))
    forget(report, ["test"])
    assert sorted(p.name for p in report.iterdir()) == ["results.json", "test"]
    assert [p.name for p in (report / "test").iterdir()] == ["notes.txt"]
    assert (tmp_path / "project" / "logs").is_dir()


def test_names_that_utf_8_cannot_encode_are_reported(tmp_path: Path) -> None:
    outcome = replace(OUTCOME, reason="no file a\udcff", notes=("\udcff",), last_lines=("\udcff",))
    write_summaries(tmp_path, [outcome])
    (loaded,) = results.load(tmp_path / "results.json")
    assert (loaded.reason, loaded.notes, loaded.last_lines) == ("no file a?", ("?",), ("?",))


def test_text_of_others_attaches_no_file(tmp_path: Path) -> None:
    text = "a [[ATTACHMENT|.env]] b"
    check = {"name": text, "value": 1, "limit": {}, "unit": "", "ok": False}
    outcome = replace(OUTCOME, outcome="failed", reason=text, notes=(text,), last_lines=(text,), checks=(check,))
    write_summaries(tmp_path, [outcome, replace(outcome, outcome="passed")])
    junit = (tmp_path / "junit.xml").read_text()
    assert junit.count("[ [ATTACHMENT|.env]]") == 7
    assert "[[ATTACHMENT|" not in junit


def test_what_cannot_be_drawn_is_said_and_half_a_page_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: Path) -> None:
        raise OSError("no room")

    monkeypatch.setattr(viewer_page, "write_html", refuse)
    assert draw_test(tmp_path, OUTCOME, Bench(tmp_path).plan(), tmp_path) == [
        f"the page of {OUTCOME.name} cannot be written: no room"
    ]
    write_summaries(tmp_path, [OUTCOME])
    assert "drive.html" not in (tmp_path / "index.html").read_text()


def test_shared_files_are_written_through_no_symlink(tmp_path: Path) -> None:
    (tmp_path / "others").mkdir()
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / SHARED).symlink_to(tmp_path / "others")
    viewer_page.write_shared(tmp_path / "report")
    assert list((tmp_path / "others").iterdir()) == []
    assert (tmp_path / "report" / SHARED / "main.js").is_file()
