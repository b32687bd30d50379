"""The shipped tests with a second car: the example passes with the same values each time, a blind one fails."""

from pathlib import Path

import pytest

from tests.drive.applications import dodo, kiwi, results

CLOSED, PERCEPTION = "sil-closed-two-cars", "sil-perception-cars"
BLIND = (
    "perception.py",
    "        for colour, found in boxes.items()\n",
    "        for colour, found in [*boxes.items()][:-1]\n",
)


@pytest.mark.slow
def test_the_example_follows_and_finds_the_other_car(tmp_path: Path) -> None:
    application, values = kiwi(tmp_path / "app"), []
    for number, names in enumerate(([CLOSED, PERCEPTION], [CLOSED])):
        report = tmp_path / f"report-{number}"
        dodo("run", *names, "--application", str(application), "--report", str(report), code=0)
        found = results(report)
        checks = {name: {c["name"]: c["value"] for c in found[name]["checks"]} for name in names}
        values.append({name: value for name, value in checks[CLOSED].items() if name != "slow-answers"})
        if number == 0:
            assert checks[PERCEPTION]["recall-car"] > 0.9
    assert values[0] == values[1], "bit for bit"
    assert 0.2 < values[0]["body-margin"] < 0.35
    assert values[0]["time-to-goal"] > 8.5, "the other car is ahead until then"


@pytest.mark.proof
def test_an_application_that_sees_no_car_fails(tmp_path: Path) -> None:
    application, report = kiwi(tmp_path / "app", BLIND), tmp_path / "report"
    dodo("run", CLOSED, PERCEPTION, "--application", str(application), "--report", str(report), code=1)
    found = results(report)
    assert found[CLOSED]["reason"].startswith("came within 0.097 m of body kiwi after 2.67 s at x = ")
    assert found[PERCEPTION]["reason"].startswith(
        "precision of car has no value (at least 0.7), because nothing was detected"
    )
