"""Formats of diagnostics, as their readers read them."""

import json
import shutil
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from junitparser import JUnitXml

from dodo_dsl.check import catalogue
from dodo_dsl.cli.compile import FORMATS
from dodo_dsl.cli.main import main
from tests.check import examples
from tests.cli.terminal import Terminal
from tests.emit.readers import run

WRONG = examples.SPEC.replace("name: example", "name: bad one").replace(
    "goal: finish", "goal: \\u00e9nd, matx-time: 1 s"
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A test without problems, one with two errors, and one with a warning."""
    examples.write("", tmp_path)
    for name, text in (
        ("bad one", WRONG),
        ("warned", examples.SPEC.replace("example", "warned") + "matrix: {a: [1]}\n"),
    ):
        (tmp_path / "tests" / name).mkdir()
        (tmp_path / "tests" / name / f"{name}.dodo.yml").write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def sarif() -> dict[str, Any]:
    code, out, _ = run("compile", "--check", "--format", "sarif")
    assert code == 2
    (found,) = json.loads(out)["runs"]
    assert isinstance(found, dict)
    return found


def test_sarif(folder: Path) -> None:
    found = sarif()
    rules = [rule["id"] for rule in found["tool"]["driver"]["rules"]]
    results = {result["ruleId"]: result for result in found["results"]}
    assert set(rules) == set(results)
    assert all(rules[result["ruleIndex"]] == result["ruleId"] for result in results.values())
    unknown = results["unknown-parameter"]
    assert unknown["level"] == "error"
    assert unknown["message"]["text"].endswith(
        "has no parameter 'matx-time' (did you mean 'max-time' or 'max-silence'?)"
    )
    (place,) = unknown["locations"]
    column = WRONG.splitlines()[-1].index("matx-time") + 1
    assert place["physicalLocation"] == {
        "artifactLocation": {"uri": "tests/bad%20one/bad%20one.dodo.yml"},
        "region": {"startLine": 13, "startColumn": column, "endColumn": column + len("matx-time")},
    }
    assert results["matrix-unused"]["level"] == "warning"


def test_fingerprints_stay_when_lines_move(folder: Path) -> None:
    before = [result["partialFingerprints"] for result in sarif()["results"]]
    bad = folder / "tests/bad one/bad one.dodo.yml"
    bad.write_text(f"# a comment\n{WRONG}")
    assert [result["partialFingerprints"] for result in sarif()["results"]] == before
    assert len({mark["dodo/v1"] for mark in before}) == len(before)


def test_junit(folder: Path) -> None:
    code, out, _ = run("compile", "--check", "--format", "junit")
    assert code == 2
    document = JUnitXml.fromstring(out.encode())
    assert (document.tests, document.failures) == (4, 1)
    cases = {case.name: case for suite in document for case in suite}
    assert list(cases) == [f"tests/{name}/{name}.dodo.yml" for name in ("bad one", "base", "example", "warned")]
    (failure,) = cases["tests/bad one/bad one.dodo.yml"].result
    assert failure.text.count("error[") == 3
    assert failure.type == failure.text.partition("error[")[2].partition("]")[0]
    assert not cases["tests/example/example.dodo.yml"].result
    assert "warning[matrix-unused]" in cases["tests/warned/warned.dodo.yml"].system_out
    assert not cases["tests/warned/warned.dodo.yml"].result


@pytest.mark.parametrize("style", [style for style in FORMATS if style != "text"])
def test_nothing_else_is_on_standard_output(folder: Path, style: str) -> None:
    _, out, _ = run("compile", "--check", "--format", style)
    assert out[0] in "<[{"
    assert out.rstrip()[-1] in ">]}"


REPORTS = ("gitlab", "sarif", "junit")


@pytest.mark.parametrize("style", REPORTS)
def test_a_report_s_text_is_in_the_log(folder: Path, style: str) -> None:
    """The standard output of a job goes into the report's file, so that the log would be empty."""
    code, text, _ = run("compile", "--check")
    assert "error[unknown-parameter]" in text
    assert "warning[matrix-unused]" in text
    assert run("compile", "--check", "--format", style)[::2] == (code, text)
    assert run("compile", "--format", style)[2] == run("compile")[1]


@pytest.mark.parametrize("style", REPORTS)
@pytest.mark.thorough
def test_what_is_stale_is_in_the_log(folder: Path, style: str) -> None:
    shutil.rmtree(folder / "tests/bad one")
    assert run("compile")[0] == 0
    spec = folder / "tests/example/example.dodo.yml"
    spec.write_text(spec.read_text().replace("goal: finish", "goal: finish, max-time: 30 s"))
    code, text, _ = run("compile", "--check")
    assert code == 1
    assert "generated is stale; dodo compile brings it up to date\n" in text
    assert run("compile", "--check", "--format", style)[::2] == (1, text)


def test_a_report_on_a_terminal_stands_there_alone(folder: Path) -> None:
    stdout, stderr = Terminal(), StringIO()
    assert main(["compile", "--check", "--format", "gitlab"], stdout, stderr) == 2
    assert json.loads(stdout.getvalue())
    assert stderr.getvalue() == ""


def test_every_rule_has_a_page(folder: Path) -> None:
    """As SARIF's descriptions of rules are made of them."""
    assert {result["ruleId"] for result in sarif()["results"]} <= set(catalogue.pages())


def test_what_planning_finds_is_told_beside_what_other_tests_have(folder: Path) -> None:
    (folder / "tests" / "taken").mkdir()
    taken = examples.SPEC.replace("example", "taken").replace("camera:", "driver:")
    (folder / "tests" / "taken" / "taken.dodo.yml").write_text(taken)
    code, out, _ = run("compile", "--check", "--format", "json")
    assert code == 2
    assert {"unknown-parameter", "service-taken"} <= {found["rule"] for found in json.loads(out)}
