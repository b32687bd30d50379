"""The tests notice each weakened safety rule of firmware/mutants.yml."""

import os
import runpy
import subprocess
import sys

import pytest
import yaml

from tests.firmware.programs import ROOT

MUTANTS = [row["name"] for row in yaml.safe_load((ROOT / "firmware" / "mutants.yml").read_text(encoding="utf-8"))]


@pytest.mark.slow
@pytest.mark.parametrize("names", [MUTANTS[::60], pytest.param(MUTANTS, marks=pytest.mark.proof)], ids=["few", "all"])
def test_each_safety_rule_has_a_test_that_notices_when_it_is_weak(bench_program: object, names: list[str]) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    words = [sys.executable, str(ROOT / "scripts" / "mutate-firmware"), *names]
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{len(names)} of {len(names)} mutants killed" in done.stdout


def test_a_mutant_whose_text_is_gone_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    script = runpy.run_path(str(ROOT / "scripts" / "mutate-firmware"), run_name="mutate")
    gone = script["Mutant"]("gone", "motion/motion.c", "no such text", "", "limits")
    with pytest.raises(ValueError, match=r"stands 0 times in motion/motion\.c"):
        script["survives"](gone, {})
