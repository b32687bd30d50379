"""Every shipped test that runs without hardware: the example application passes it, and wrong ones fail it rightly."""

from pathlib import Path

import pytest

from tests.drive.applications import BLIND, STOPS, SWAPPED, dodo, kiwi, results

REVERSED = {"steering": "--reverse"}
WRONG = [
    ("reversed", None, REVERSED, {
        "sil-closed-straight": "hit wall ",
        "sil-closed-left-curve": "hit wall ",
        "sil-closed-kiwi-track": "hit wall ",
        "sil-open-straight": "the mean distance is ",
        "sil-open-left-curve": "the mean distance is ",
        "dil-kiwi-track": "the mean distance is ",
    }),
    ("blind", BLIND, {}, {
        "sil-closed-left-curve": "did not reach finish",
        "sil-open-left-curve": "the mean distance is ",
        "dil-kiwi-track": "the mean distance is ",
        "dil-static-rig": "no detection came",
    }),
    ("swapped", SWAPPED, {}, {
        "sil-closed-left-curve": "hit wall right",
        "dil-static-rig": "precision",
        "sil-perception--light-1--clutter-60": "precision is 0 ",
    }),
    ("stops", STOPS, {}, {"sil-closed-straight": "did not reach finish"}),
]  # fmt: skip


def test_the_example_passes_open_loop_and_recordings(tmp_path: Path) -> None:
    report = tmp_path / "report"
    dodo("run", "sil-open-*", "sil-perception*clutter-60", "dil-*", "--report", str(report), code=0)
    tests = results(report)
    assert set(tests) >= {"sil-open-straight", "sil-open-left-curve", "dil-static-rig", "dil-kiwi-track"}
    for slug, test in tests.items():
        assert (test["outcome"], test["checks"] != []) == ("passed", True), test
        assert (report / slug / "test.rec").stat().st_size > 10_000
    counts = {c["name"]: c["value"] for c in tests["dil-static-rig"]["checks"]}
    assert counts["true-positives"] > 300


@pytest.mark.parametrize(("wrong", "edit", "words", "reasons"), WRONG, ids=[w[0] for w in WRONG])
def test_wrong_applications_fail_for_the_right_reason(
    wrong: str, edit: tuple[str, str, str] | None, words: dict[str, str], reasons: dict[str, str], tmp_path: Path
) -> None:
    application = kiwi(tmp_path / "app", edit, **words)
    report = tmp_path / "report"
    dodo("run", *reasons, "--clock", "lockstep", "--application", str(application), "--report", str(report), code=1)
    for slug, test in results(report).items():
        assert test["outcome"] == "failed", (wrong, test)
        assert reasons[slug] in test["reason"], (wrong, test)
