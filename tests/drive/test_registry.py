"""Every shipped test that runs without hardware: the example application passes it, and wrong ones fail it rightly."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.drive.applications import BLIND, LEAVES, ROOT, STAMPED, STOPS, SWAPPED, dodo, kiwi, results

REVERSED = {"steering": "--reverse"}
WRONG = [
    ("reversed", None, REVERSED, {
        "sil-closed-straight": r"hit wall \w+ after .* s at x = ",
        "sil-closed-kiwi-track": "hit wall ",
        "sil-open-straight": "the mean distance is ",
        "dil-kiwi-track": "the mean distance is ",
    }),
    ("blind", BLIND, {}, {
        "sil-open-left-curve": "the mean distance is ",
        "dil-static-rig": "no detection came",
    }),
    ("swapped", SWAPPED, {}, {
        "sil-closed-left-curve": "hit wall right",
        "sil-perception--light-1--clutter-60": "precision is 0 ",
    }),
    ("stamped", STAMPED, {}, {
        "sil-open-left-curve": r"no opendlv\.proxy\.GroundSteeringRequest/0 came, but \d+ with sender stamp 99$",
    }),
    ("stops", STOPS, {}, {"sil-closed-straight": "did not reach finish"}),
]  # fmt: skip

pytestmark = pytest.mark.slow


def test_the_example_passes_in_lockstep(tmp_path: Path) -> None:
    """Closed and open loop, perception, and recordings: each picture is answered."""
    names = ("sil-closed-straight", "sil-closed-kiwi-track", "sil-open-*", "sil-perception*clutter-60", "dil-*")
    dodo("run", *names, "-j", "2", "--report", str(tmp_path), code=0)
    tests = results(tmp_path)
    closed, opened = {"sil-closed-straight", "sil-closed-kiwi-track"}, {"sil-open-straight", "sil-open-left-curve"}
    assert set(tests) >= {*closed, *opened, "dil-static-rig", "dil-kiwi-track"}
    assert {t["clock"] for t in tests.values()} == {"lockstep"}
    assert sum(t["sim_s"] for t in tests.values()) > 40
    for slug, test in tests.items():
        assert (test["outcome"], test["checks"] != []) == ("passed", True), test
        assert (tmp_path / slug / "test.rec").stat().st_size > 10_000
    counts = {c["name"]: c["value"] for c in tests["dil-static-rig"]["checks"]}
    assert counts["true-positives"] > 300


@pytest.mark.parametrize(("wrong", "edit", "flags", "reasons"), WRONG, ids=[w[0] for w in WRONG])
def test_wrong_applications_fail_for_the_right_reason(
    wrong: str, edit: tuple[str, str, str] | None, flags: dict[str, str], reasons: dict[str, str], tmp_path: Path
) -> None:
    application = kiwi(tmp_path / "app", edit, **flags)
    report = tmp_path / "report"
    words = ("--application", str(application), "--report", str(report))
    out = dodo("run", *reasons, *words, code=1)
    tests = results(report)
    assert set(tests) == set(reasons)
    for slug, test in tests.items():
        assert test["outcome"] == "failed", (wrong, test)
        assert re.search(reasons[slug], test["reason"]), (wrong, test)
        assert test["reason"] in out


def test_an_application_may_end_with_its_recording(tmp_path: Path) -> None:
    """In real time, so that a busy machine may cost it frames: but that it went is no fault of it."""
    application, report = kiwi(tmp_path / "app", LEAVES), tmp_path / "report"
    words = ("dil-static-rig", "--clock", "realtime", "--application", str(application), "--report", str(report))
    subprocess.run(
        [sys.executable, "-m", "dodo_dsl", "run", *words], check=False, cwd=ROOT, timeout=300, capture_output=True
    )
    test = results(report)["dil-static-rig"]
    assert {s["name"]: s["exit_code"] for s in test["services"]}["perception"] == 0, "it ended by itself"
    assert test["outcome"] != "error" and test["checks"], "it was judged"
    assert "before the test was decided" not in test["reason"]
