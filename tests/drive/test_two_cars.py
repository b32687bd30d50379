"""The shipped tests with a second car fail an application that does not see it; the example passes (test_judge)."""

from pathlib import Path

import pytest

from tests.drive.applications import dodo, kiwi, results

CLOSED, PERCEPTION = "sil-closed-two-cars", "sil-perception-cars"
BLIND = (
    "perception.py",
    "        for colour, found in boxes.items()\n",
    "        for colour, found in [*boxes.items()][:-1]\n",
)


@pytest.mark.proof
def test_an_application_that_sees_no_car_fails(tmp_path: Path) -> None:
    application, report = kiwi(tmp_path / "app", BLIND), tmp_path / "report"
    dodo("run", CLOSED, PERCEPTION, "--application", str(application), "--report", str(report), code=1)
    found = results(report)
    assert found[CLOSED]["reason"].startswith("came within 0.097 m of body kiwi after 2.67 s at x = ")
    assert found[PERCEPTION]["reason"].startswith(
        "precision of car has no value (at least 0.7), because nothing was detected"
    )
