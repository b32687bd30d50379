"""``results.json`` is read only when it is one."""

import json
import math
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import pytest

from dodo_dsl.outcome import MachineLoad, NotRun, Response, ServiceUse, Wait
from dodo_dsl.report import results
from dodo_dsl.report.files import forget
from dodo_dsl.report.report_folder import write_summaries
from dodo_dsl.report.results import GivenReport, Repository, RunRecord
from dodo_dsl.spec.model import Goal
from tests.contributing import results_schema
from tests.report.test_report_folder import OUTCOME

STRANGE = [
    {"slug": 3},
    {"outcome": "maybe"},
    {"reason": "\ud800"},
    {"machine": {}},
    {"goals": [{"check": "time", "zero": 1, "one": 1, "weight": 1}]},
    {"goals": [{"check": "time", "zero": math.nan, "one": 1, "weight": 1}]},
    {"goals": [{"check": "time", "zero": 0, "one": 1, "weight": 1e308}]},
]


@pytest.mark.parametrize("change", STRANGE, ids=str)
def test_results_of_a_strange_shape_are_refused_and_stop_no_run(tmp_path: Path, change: dict[str, object]) -> None:
    document = json.loads(results.to_json([OUTCOME]))
    document["tests"][0].update(change)
    (tmp_path / "results.json").write_text(json.dumps(document))
    with pytest.raises(results.ResultsError):
        results.load(tmp_path / "results.json")
    forget(tmp_path, ["test"])


LOAD = MachineLoad(
    7.5, 2, Wait(1.0, 2.0, 1.9, "app"), Wait(1.5, 0.5, 0.4, "camera"), 0.61, 7.5, 0.05, 0.02, 0.06, undecided=True
)


def test_what_services_used_is_kept_and_drawn(tmp_path: Path) -> None:
    uses = (
        ServiceUse("steering", 1.23456, 0.25049, 150_000_000),
        ServiceUse("vision", 2.0, None, 1_460_000_000),
    )
    write_summaries(tmp_path, [replace(OUTCOME, resources=uses)])
    first, second = results.load(tmp_path / "results.json")[0].resources
    assert (first, second) == (replace(uses[0], processor_s=1.235, processor_share=0.25), uses[1])
    page = (tmp_path / "index.html").read_text()
    for use in uses:
        assert f"<dt>Used by {use.service}</dt><dd>{use.in_words()}" in page
    assert second.in_words() == "2.00 s of processor time, up to 1,460 MB of memory"


def test_results_that_cannot_be_read_stop_no_run(tmp_path: Path) -> None:
    (tmp_path / "results.json").mkdir()
    with pytest.raises(results.ResultsError, match="cannot be read: Is a directory"):
        results.load(tmp_path)
    forget(tmp_path, ["test"])


NOT_RUN = NotRun("b[light=1]", "b--light-1", "b/b.dodo.yml", "sil", "the run was interrupted")


def test_tests_that_never_began_have_no_outcome_and_are_skipped(tmp_path: Path) -> None:
    circumstances = results.Circumstances(
        not_run=(replace(NOT_RUN, spec="b\udcff"), replace(NOT_RUN, name="<c>", slug="c"))
    )
    write_summaries(tmp_path, [OUTCOME], circumstances)
    found = results.read_given(tmp_path / "results.json")
    assert [test.slug for test in found.circumstances.not_run] == ["b--light-1", "c"]
    assert results.load(tmp_path / "results.json") == [OUTCOME]
    cases = ElementTree.parse(tmp_path / "junit.xml").findall(".//testcase")
    skipped = [(case.get("name"), part.get("message")) for case in cases for part in case.findall("skipped")]
    assert skipped == [(name, "not run: the run was interrupted") for name in ("b[light=1]", "<c>")]
    page = (tmp_path / "index.html").read_text()
    assert "1 failed</span>" in page and ", 2 not run</h1>" in page
    assert "<li>&lt;c&gt;: the run was interrupted</li>" in page


def test_a_test_that_ran_in_one_report_was_not_left_out_of_the_joined_one() -> None:
    ran = GivenReport(Path(), [replace(OUTCOME, slug=NOT_RUN.slug)], results.NO_CIRCUMSTANCES)
    left = GivenReport(Path(), [], results.Circumstances(not_run=(NOT_RUN, replace(NOT_RUN, slug="c"))))
    assert [test.slug for test in results.joined([ran, left, left]).not_run] == ["c"]


RUN = RunRecord(
    "2026-11-23T04:10:00+00:00", "a-<host>", "0.1.0", "dodo run --seed 3", (Repository("tests", "a" * 40, True),)
)


def test_results_and_page_say_of_which_run_they_are(tmp_path: Path) -> None:
    write_summaries(tmp_path, [OUTCOME], results.Circumstances((RUN,)))
    assert results.read_given(tmp_path / "results.json").circumstances.runs == (RUN,)
    page = (tmp_path / "index.html").read_text()
    said = (
        f"2026-11-23 04:10 UTC on a-&lt;host&gt; with DoDo 0.1.0, tests at commit {'a' * 12} with uncommitted changes"
    )
    assert f"{said}: <code>dodo run --seed 3</code>" in page
    suite = ElementTree.parse(tmp_path / "junit.xml").find(".//testsuite")
    assert suite is not None
    assert (suite.get("timestamp"), suite.get("hostname")) == ("2026-11-23T04:10:00", "a-<host>")


def test_joined_results_are_of_all_runs_each_once() -> None:
    one, other = (GivenReport(Path(), [], results.Circumstances((run,))) for run in (RUN, replace(RUN, host="b")))
    assert [run.host for run in results.joined([one, other, one]).runs] == ["a-<host>", "b"]


WHOLE = replace(
    OUTCOME,
    services=({"name": "camera", "layer": "environment", "uses": "virtual-camera", "exit_code": 0},),
    checks=({"name": "x", "value": 1.0, "limit": {"max": 2.0}, "unit": "m", "ok": True},),
    verdicts=({"evaluator": "track", "outcome": "failed", "reason": "hit wall", "evidence": {"time": 1.0}},),
    goals=(Goal("time-to-goal", 20.0, 5.0, 2.0),),
    machine=LOAD,
    response=Response(9, 0.1, 0.01, 0.02, 0.03, 0, None, "a processor"),
)


@pytest.mark.parametrize("tests", [[0] * 400_000, {str(n): n for n in range(100_000)}], ids=["list", "mapping"])
def test_the_first_problem_is_told_in_a_sentence(tmp_path: Path, tests: object) -> None:
    (tmp_path / "results.json").write_text(json.dumps({"dodo": "results", "version": 1, "tests": tests}))
    with pytest.raises(results.ResultsError, match=r"not results of DoDo \(Expected .* at `\$\.tests") as caught:
        results.read_given(tmp_path / "results.json")
    assert len(str(caught.value)) < 1000


def test_the_schema_is_what_the_classes_say_and_what_is_written_is_read(tmp_path: Path) -> None:
    assert results_schema.FILE.read_text() == results_schema.text(), "run `make schema`"
    text = results.to_json([WHOLE], circumstances := results.Circumstances((RUN,), (NOT_RUN,)))
    document = json.loads(text)
    jsonschema.validate(document, json.loads(results_schema.text()))
    (tmp_path / "results.json").write_text(text)
    found = results.read_given(tmp_path)
    assert (found.outcomes, found.circumstances) == ((WHOLE,), circumstances)
