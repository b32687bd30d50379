"""The tests notice each weakened safety rule of mutants.yml."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.firmware.programs import ROOT

TESTS = [*yaml.safe_load(Path(__file__).with_name("mutants.yml").read_text(encoding="utf-8"))]


@pytest.mark.slow
@pytest.mark.parametrize("names", [TESTS[::40], pytest.param(TESTS, marks=pytest.mark.proof)], ids=["few", "all"])
def test_each_safety_rule_has_a_test_that_notices_when_it_is_weak(bench_program: object, names: list[str]) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    words = [sys.executable, str(ROOT / "scripts" / "mutate-firmware"), *names]
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
