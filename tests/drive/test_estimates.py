"""Whole tests in lockstep with an application that says where it believes that it is."""

from pathlib import Path
from typing import Any

import pytest

from tests.drive.applications import dodo, program, results

pytestmark = pytest.mark.slow

TEST = """\
dodo: 1
name: where
description: Say where you are on a curve.
level: sil
kind: open-loop
timeout: 30 s
clock: lockstep
pose: declared
environment:
  pose: {uses: beacon, with: {points: ["0 0", "2 0", "3 1", "3 3"], speed: 1 m/s}}
evaluation:
  estimates: {uses: trajectory-error, with: {max-ate: 6 cm, max-rotation: 0.2 deg, max-rpe: 1 mm, delta-unit: s}}
"""
BELIEVES = """\
import sys
from dodo_dsl.opendlv import Session
with Session(int(next(word[6:] for word in sys.argv if word.startswith("--cid=")))) as session:
    estimate = session.messages.type("robot.PoseEstimate")
    while True:
        heard = session.receive(1.0)
        if heard and heard.data_type == session.messages.id("opendlv.sim.Frame") and heard.sample_time % 70_000 == 0:
            at = session.messages.decode(heard.data_type, heard.payload)
            session.send(estimate(x=at.x + 0.03, y=at.y - 0.04, qz=at.qz, qw=at.qw), heard.sample_time)
"""


def test_a_known_error_is_measured_the_same_each_time(tmp_path: Path) -> None:
    found: list[Any] = []
    spec, report = tmp_path / "tests" / "where" / "where.dodo.yml", tmp_path / "report"
    spec.parent.mkdir(parents=True)
    spec.write_text(TEST)
    (tmp_path / "believes.py").write_text(BELIEVES)
    told = {"in": ["opendlv.sim.Frame"], "out": ["robot.PoseEstimate"]}
    compose = program(tmp_path, "python", "believes.py", **{"x-dodo": told})
    for _ in range(2):
        dodo("run", str(spec), "--application", str(compose), "--report", str(report), code=0)
        test = results(report)["where"]
        found.append((test["reason"], test["checks"], test["sim_s"]))
    assert found[0] == found[1]
    values = {check["name"]: check["value"] for check in found[0][1]}
    assert found[0][0].startswith("78 estimates kept to the true pose: ate 0.05 m (at most 0.06), rotation 0 deg ")
    assert (values["ate"], values["rpe"]) == pytest.approx((0.05, 0.0), abs=1e-6)
    assert (values["estimates"], values["gap"]) == (78, 0.07)
