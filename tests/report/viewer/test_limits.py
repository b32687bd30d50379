"""Which lines of a spec set a check's limit."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Place
from dodo_dsl.report.viewer.page import checks, spec_lines
from tests.report.viewer.drives import ROOT, check, shipped

RESPONSE = "response: {max: 100 ms, over: 10 %, sample-times: copied}"
OUTCOME = Outcome("t", "t", "t.dodo.yml", "sil", "open-loop", "failed", "bad", 130, 0, "lockstep", "process")


RECORDED = {"signal": {"mean-over-time": ("max-mean",)}}
RESOURCES = Place("tests_registry/dil-static-rig/dil-static-rig.dodo.yml", 9, 1)


def test_the_place_of_a_limit_of_memory() -> None:
    plan = shipped("dil-static-rig")
    plan = replace(plan, source_map={**plan.source_map, "resources": RESOURCES})
    outcome = replace(OUTCOME, checks=(check("peak-memory-perception", 210.0, False, max=200),))
    (found,) = checks(plan, outcome, RECORDED, (ROOT,))
    assert [(p["isDefault"], p["line"]) for p in found["places"]] == [(False, 9)]


@pytest.mark.parametrize(
    ("slug", "name", "expected"),
    [
        ("sil-open-straight", "distance", [(False, 22, "max-distance: 0.06")]),
        ("sil-open-straight", "mean-over-time", [(False, 20, "max-mean: 0.014")]),
        ("sil-open-straight", "gap", [(True, 14, "signal:")]),
        ("sil-open-straight", "unheard-of", []),
        ("sil-open-straight", "slow-answers", []),
        ("dil-static-rig", "slow-answers", [(False, 10, RESPONSE)]),
        ("dil-static-rig", "uncopied-sample-times", [(False, 10, RESPONSE)]),
    ],
)
def test_places_of_limits(slug: str, name: str, expected: list[tuple[bool, int, str]]) -> None:
    plan = shipped(slug)
    outcome = replace(OUTCOME, checks=(check(name, 1.0, False, max=0.5),))
    (found,) = checks(plan, outcome, RECORDED, (ROOT,))
    assert [(p["isDefault"], p["line"], p["text"]) for p in found["places"]] == expected


def test_only_files_below_the_repository_are_read(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("key\n")
    (tmp_path / "repository").mkdir()
    (tmp_path / "repository" / "link").symlink_to(tmp_path / "secret")
    assert [spec_lines(name, [tmp_path / "repository"]) for name in ("../secret", "link", "gone")] == [[], [], []]
