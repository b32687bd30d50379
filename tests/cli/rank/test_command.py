"""dodo rank: teams from files, tables, and what it refuses."""

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.report import results
from dodo_dsl.spec.model import Goal
from tests.cli.rank.test_score import run


def ranked(*words: str) -> tuple[int, str]:
    out, err = io.StringIO(), io.StringIO()
    return main(["rank", *words], out, err), out.getvalue() + err.getvalue()


@pytest.fixture
def teams(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    runs = {"blue": [run(15.0), run(14.0)], "red": [run(12.0), run(11.0, outcome="failed")], "green": [run(12.0)]}
    for name, outcomes in runs.items():
        Path(name).mkdir()
        Path(name, "results.json").write_text(results.to_json(outcomes))
    return tmp_path


def test_a_table_of_teams(teams: Path) -> None:
    code, text = ranked("blue/results.json", "red", "a|b=green/results.json")
    assert code == 0
    assert text.splitlines()[:4] == [
        "rank  team  score  failed  no answer  runs",
        "1     a|b   0.850  0 of 1  0          1",
        "2     blue  0.662  0 of 1  0          2",
        "3     red   0.425  1 of 1  0          2",
    ]


def test_json_has_each_run(teams: Path) -> None:
    code, text = ranked("blue=blue", "blue=green", "--format", "json")
    (team,) = json.loads(text)["teams"]
    assert (code, team["rank"], team["team"]) == (0, 1, "blue")
    assert team["tests"]["t"]["runs"] == pytest.approx([0.625, 0.7, 0.85])


def test_what_cannot_be_compared_is_refused(teams: Path) -> None:
    assert ranked("blue", "./blue") == (
        2,
        "dodo rank: two results are of team 'blue'; name them, as in blue-2=./blue\n",
    )
    assert "two results are of team 'blue'" in ranked("blue", "blue=red")[1]
    assert ranked("none/results.json") == (2, "dodo rank: there is no none/results.json\n")
    other = replace(run(15.0), goals=(Goal("time", 30.0, 10.0),))
    Path("green", "results.json").write_text(results.to_json([other]))
    code, text = ranked("blue", "green")
    assert code == 2 and "the goals of test 't' differ between the results of 'blue' and 'green'" in text
    Path("green", "results.json").write_text(results.to_json([]))
    assert ranked("green") == (2, "dodo rank: the results of team 'green' have no test\n")
