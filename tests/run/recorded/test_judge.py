"""Evaluators are processes: what they print and how they end decides, as in a run."""

import sys
from pathlib import Path

import pytest

from dodo_dsl.plan.model import PlannedService
from dodo_dsl.run.judge import Judgement, judge
from dodo_dsl.run.test_recording import TestRecording, inspect
from tests.run.helpers import FAIL, PASS, READY
from tests.run.recorded.made import begin, step, write
from tests.run.scripted import plan

pytestmark = pytest.mark.slow

CLOCK = """
import os
assert (os.environ["DODO_CLOCK"], "DODO_RIG" in os.environ) == ("recording", False)
assert os.environ["DODO_RECORDING"].endswith("/test.rec")
"""


@pytest.fixture
def recording(tmp_path: Path) -> TestRecording:
    return inspect(write(tmp_path / "test.rec", step(1, 0), begin(), step(2, 5_240_000)))


def judged(folder: Path, recording: TestRecording, **scripts: str) -> Judgement:
    services = []
    for name, script in scripts.items():
        path = folder / f"{name}.py"
        path.write_text(READY + script)
        services.append(PlannedService("evaluation", name, "x", "x", (sys.executable, str(path)), judge=True))
    (folder / "work").mkdir()
    return judge(plan("t", lockstep=9.0, services=tuple(services), rig="desk"), folder, recording, 130, folder / "work")


def test_one_that_fails_decides(tmp_path: Path, recording: TestRecording) -> None:
    said = judged(tmp_path, recording, track=CLOCK + PASS, walls="import sys; print('tail', file=sys.stderr)\n" + FAIL)
    assert (said.finding.result, said.finding.reason) == ("failed", "hit wall left")
    assert said.last_lines == ("tail",)


REASONS = {
    "silent": ("", "the recording ends after 5.2 s, before evaluator 'track' gave a verdict"),
    "broken": ("raise SystemExit(2)", "evaluator 'track' ended with exit code 2"),
}


@pytest.mark.parametrize("case", REASONS)
def test_an_error_says_why(case: str, tmp_path: Path, recording: TestRecording) -> None:
    script, reason = REASONS[case]
    said = judged(tmp_path, recording, track=script, other=PASS)
    assert (said.finding.result, said.finding.reason) == ("error", reason)
