"""Shipped tests that run without hardware, and applications that are wrong."""

import re
from pathlib import Path

import pytest

from tests.drive.applications import LEAVES, dodo, kiwi, results
from tests.faulty.matrix import APPLICATION


@pytest.mark.slow
def test_a_drive_that_leaves_the_track_fails_where_it_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What else is wrong with applications, tests/faulty tries."""
    monkeypatch.setenv("FAULT", "steering-reversed")
    names = ("sil-closed-straight", "sil-closed-kiwi-track", "sil-closed-left-curve")
    out = dodo("run", *names, "--application", str(APPLICATION), "-j", "2", "--report", str(tmp_path), code=1)
    tests = results(tmp_path)
    assert set(tests) == set(names)
    for test in tests.values():
        assert test["outcome"] == "failed", test
        assert re.fullmatch(r"hit wall \w+ after .* s at x = .* m, y = .* m", test["reason"]), test
        assert test["reason"] in out


@pytest.mark.realtime
def test_an_application_may_end_with_its_recording(tmp_path: Path) -> None:
    """In real time, so that a busy machine may cost it frames: but that it went is no fault of it."""
    application, report = kiwi(tmp_path / "app", LEAVES), tmp_path / "report"
    words = ("dil-static-rig", "--clock", "realtime", "--application", str(application), "--report", str(report))
    dodo("run", *words, code=(0, 1, 3))
    test = results(report)["dil-static-rig"]
    assert {s["name"]: s["exit_code"] for s in test["services"]}["perception"] == 0, "it ended by itself"
    assert test["checks"] and (test["outcome"] != "error" or test["machine"]["undecided"]), "it was judged"
    assert "before the test was decided" not in test["reason"]
