"""``dodo explain``: rules, and the wiring of tests as people and programs read it."""

import json
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.check import catalogue
from dodo_dsl.cli.main import main
from tests.check import examples

GOLDEN = Path(__file__).parent / "explained"
MATRIX = """\
matrix: {yaw: [80 deg, 100 deg], frame-id: [0, 3]}
action:
  vehicle: {uses: dynamic-model, with: {frame-id: "${matrix.frame-id}"}}
  pose: {uses: integrator, with: {yaw: "${matrix.yaw}", frame-id: "${matrix.frame-id}"}}
"""
VARIABLES = """\
matrix: {speed: [0.5, 1]}
application: {env: {SPEED: "${matrix.speed}", MODE: careful}}
"""
DECLARED = """\
# docker-compose.yml
services:
  eyes: {image: eyes, command: --cid=111, x-dodo: {in: [], out: [opendlv.logic.perception.DetectionType/4]}}
  driver:
    image: driver
    x-dodo:
      in: [opendlv.logic.perception.DetectionType, opendlv.sim.Frame]
      out: [opendlv.proxy.GroundSteeringRequest]
"""
CASES = {
    "plain": "",
    "matrix": MATRIX,
    "variables": VARIABLES,
    "declared": DECLARED,
}


def explained(*words: str) -> tuple[int, str, str]:
    stdout, stderr = StringIO(), StringIO()
    code = main(["explain", *words], stdout, stderr)
    return code, stdout.getvalue(), stderr.getvalue()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("case", CASES)
def test_a_test(case: str, folder: Path, update_goldens: bool) -> None:
    """The whole of a plain test, and what others have that it does not."""
    example = CASES[case]
    examples.write(f"dodo: 1\n{example}" if "extends" in example else example, folder)
    code, out, err = explained("example")
    text = f"{out}\nexit {code}\n{err}"
    if case != "plain":
        plain = {" ".join(line.split()) for line in (GOLDEN / "plain.out").read_text().splitlines()}
        text = "".join(f"{line}\n" for line in text.splitlines() if " ".join(line.split()) not in plain)
    expected = GOLDEN / f"{case}.out"
    if update_goldens:
        expected.write_text(text)
    assert text == expected.read_text()


def test_json_has_the_same(folder: Path) -> None:
    examples.write(MATRIX, folder)
    code, out, _ = explained("example", "--json")
    assert code == 2
    rows = json.loads(out)
    assert [row["slug"] for row in rows][:2] == ["example--yaw-80-deg--frame-id-0", "example--yaw-80-deg--frame-id-3"]
    assert rows[3]["services"][2]["values"]["yaw"] == "100 deg"
    assert rows[0]["asked"][0]["port"] == "opendlv.proxy.GroundSteeringRequest"


def test_a_rule() -> None:
    code, out, err = explained("wrong-unit")
    assert (code, err) == (0, "")
    assert out == catalogue.text(catalogue.pages()["wrong-unit"])
    assert json.loads(explained("wrong-unit", "--json")[1])["bad"] == "timeout: 60"


def test_all_rules_have_a_line() -> None:
    lines = explained()[1].splitlines()
    assert [line.split()[0] for line in lines] == list(catalogue.pages())
