"""Which values of an earlier result a test is compared with."""

import json
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.check import baseline
from dodo_dsl.check.baseline import resolved_baseline
from dodo_dsl.outcome import against_baseline
from dodo_dsl.spec.matrix import Choice
from dodo_dsl.spec.model import RecordedValue, Spec
from dodo_dsl.spec.registry import Location
from tests.source.nodes import mapping, value


def check(name: str, number: float | None, **limit: float) -> dict[str, Any]:
    return {"name": name, "value": number, "limit": limit, "unit": "", "ok": True}


def resolved(folder: Path, written: str, **more: Any) -> tuple[RecordedValue, ...]:
    """The values for a test ``a``, whose spec is in the folder of its name."""
    node = mapping(f"baseline: {written}", str(folder / "a/a.dodo.yml"))
    (folder / "a").mkdir(exist_ok=True)
    spec = Spec(Location(folder / "a/a.dodo.yml", folder), name="a", baseline=node.entries["baseline"], **more)
    found = resolved_baseline(spec)
    assert not found.problems, found.problems
    return found.values


@pytest.fixture
def results(tmp_path: Path) -> Path:
    checks = [check("mean", 0.1, max=1), check("late", 3), check("mean", 0.2, max=1), check("lag", None, max=1)]
    tests = [{"slug": slug, "checks": checks} for slug in ("b", "a", "a--light-dark")]
    tests[0]["checks"] = [check("mean", 9, max=10)]
    tests[2]["checks"] = [check("baseline-mean", 1, max=1), check("share", 0.5, min=0.4)]
    (tmp_path / "r.json").write_text(json.dumps({"dodo": "results", "version": 1, "tests": tests}))
    return tmp_path


def test_values_with_limits_of_the_test_itself(results: Path) -> None:
    both = (RecordedValue("mean", 0.1, 0.05), RecordedValue("mean", 0.2, 0.05, 1))
    assert resolved(results, "../r.json") == both
    assert resolved(results, "{results: ../r.json, tolerance: 20 %, checks: [mean]}") == tuple(
        RecordedValue(each.check, each.value, 0.2, each.number) for each in both
    )


def test_an_instance_has_its_own_and_comparisons_are_not_compared(results: Path) -> None:
    dark = value("dark")
    choice = Choice((("light", dark),))  # type: ignore[arg-type]
    assert resolved(results, "../r.json", choice=choice) == (RecordedValue("share", 0.5, 0.05),)


def test_without_a_baseline_nothing_is_compared(tmp_path: Path) -> None:
    assert resolved_baseline(Spec(Location(tmp_path / "a.dodo.yml", tmp_path))).values == ()
    assert list(against_baseline([check("mean", 1, max=2)], ())) == []


@pytest.mark.parametrize(
    ("now", "before", "tolerance", "limit", "ok"),
    [
        (check("x", 1.1, max=5), 1.0, 0.1, {"max": 1.1}, True),
        (check("x", 1.2, max=5), 1.0, 0.1, {"max": 1.1}, False),
        (check("x", -1.2, min=-5), -1.0, 0.1, {"min": -1.1}, False),
        (check("x", 0.2, max=2), 0.0, 0.1, {"max": 0.2}, True),
        (check("x", 1, max=0), 0.0, 0.1, {"max": 0.0}, False),
        (check("x", None, max=2), 1.0, 9.0, {"max": 10.0}, False),
        (check("x", 2.9, min=0, max=4), 3.0, 0.0, {"max": 3.0}, True),
        (check("x", 3.1, min=0, max=4), 3.0, 0.0, {"max": 3.0}, False),
    ],
)
def test_the_side_of_the_limit_says_what_is_worse(
    now: dict[str, Any], before: float, tolerance: float, limit: dict[str, float], ok: bool
) -> None:
    ((found, _),) = against_baseline([now], [RecordedValue("x", before, tolerance)])
    assert (found["limit"], found["ok"]) == (pytest.approx(limit), ok)
    assert found["margin"] is None or (found["margin"] >= 0) is ok


@pytest.mark.parametrize(
    "wrong",
    [{"value": 10**400}, {"name": "\x1b[31m"}, {"name": "\ud800"}, {"value": float("nan")}],
    ids=["huge", "control", "surrogate", "nan"],
)
def test_what_no_report_holds_is_no_baseline(tmp_path: Path, wrong: dict[str, Any]) -> None:
    tests = [{"slug": "a", "checks": [{**check("mean", 0.1, max=1), **wrong}]}]
    (tmp_path / "r.json").write_text(json.dumps({"dodo": "results", "version": 1, "tests": tests}))
    found = baseline.results(tmp_path / "r.json", 0)
    assert isinstance(found, str) and found.startswith("not a results.json of DoDo")
