"""The command line of dodo judge: what it refuses, and what it prints."""

import io
from pathlib import Path

import pytest

from dodo_dsl.cli.judge import as_pieces
from dodo_dsl.cli.main import main
from dodo_dsl.outcome import with_margin
from dodo_dsl.plan.model import Application, Plan
from dodo_dsl.run.judge import Judgement
from dodo_dsl.run.protocol import Finding, VerdictEvent
from dodo_dsl.run.test_recording import TestRecording
from tests.check import examples
from tests.run.recorded.made import begin, message, step, write


def refused(*words: str | Path) -> str:
    out, err = io.StringIO(), io.StringIO()
    assert main(["judge", *map(str, words)], out, err) == 2, out.getvalue()
    return out.getvalue() + err.getvalue()


@pytest.fixture
def recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    examples.write("clock: lockstep\n", tmp_path)
    monkeypatch.chdir(tmp_path)
    return write(tmp_path / "test.rec", step(1, 0), begin(), step(2, 1_000_000))


def test_files_and_tests_that_are_not_there(recording: Path) -> None:
    assert refused("none.rec", "--spec", "example") == "dodo judge: none.rec: No such file or directory\n"
    assert refused(recording, "--spec", "exampel").startswith("dodo judge: unknown test 'exampel'; did you mean")
    other = write(recording.with_name("other.rec"), message("opendlv.proxy.PedalPositionRequest", 3, 3))
    assert "has no dodo.TestBegin (2900)" in refused(other, "--spec", "example")


def test_a_spec_is_needed(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused(recording)
    assert "the following arguments are required: --spec" in capsys.readouterr().err


def test_of_a_matrix_one_instance_is_named(recording: Path) -> None:
    examples.write("matrix: {x: [1, 2]}\nclock: lockstep\n", recording.parent)
    assert "'example' means 2 tests, expected one, such as 'example[x=1]', 'example[x=2]'" in refused(
        recording, "--spec", "example"
    )


def test_a_spec_without_evaluators_is_refused(recording: Path) -> None:
    (spec,) = recording.parent.rglob("example.dodo.yml")
    text = spec.read_text()
    spec.write_text(text[: text.index("evaluation:")] + "evaluation: {}\n")
    assert "error[" in refused(recording, "--spec", "example")


PLAN = Plan(
    "drive", "drive", "drive.dodo.yml", "", "sil", "closed-loop", 9.0, "lockstep", "network", 0, 111, "", "sil", "", (),
    Application(".", ()),
)  # fmt: skip


def test_the_text_has_checks_and_evidence() -> None:
    checks: tuple[dict[str, object], ...] = (
        {"name": "time-to-goal", "value": None, "limit": {"max": 3.0}, "unit": "s", "ok": False},
        {"name": "gates", "value": 2, "limit": {}, "unit": "", "ok": True},
        with_margin({"name": "wall-margin", "value": 0.25, "limit": {"min": 0.125}, "unit": "m", "ok": True}),
    )
    verdict = VerdictEvent("track", False, "too late", checks, {"time": 3.01, "obstacle": "left"})
    judgement = Judgement(Finding("failed", "too late", "track"), (verdict,))
    recording = TestRecording(Path("a.rec"), "lockstep", 5.0)
    assert "".join(text for text, _ in as_pieces(PLAN, recording, judgement)) == (
        "a.rec: 5.0 s in lockstep\n"
        "FAILED  drive  too late\n"
        "\n"
        "track failed\n"
        "  time-to-goal     none (at most 3 s)  broken\n"
        "  gates            2\n"
        "  wall-margin      0.25 m (at least 0.125 m), margin 0.125 m\n"
        "  time             3.01\n"
        "  obstacle         left\n"
    )
