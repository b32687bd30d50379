"""Suites to render, and GitLab's own schema as their judge."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl import compiler
from dodo_dsl.plan.model import Plan

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def plan() -> Plan:
    """The Plan of a shipped sil test."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        checked = compiler.load([ROOT / "tests_registry/sil-closed-straight"])
        made = compiler.plan(checked, ROOT / "generated")
    assert not made.problems
    return made.compiled.suite.plans[0]


@pytest.fixture(scope="session")
def on_rig(plan: Plan) -> Callable[[str, str], Plan]:
    """The same test by another name on a rig."""

    def build(slug: str, rig: str) -> Plan:
        tag = "sil" if rig == "emulated" else "hil-dynamic"
        return replace(plan, name=slug, slug=slug, level="hil", rig=rig, tag=tag)

    return build


@pytest.fixture(scope="session")
def accepted() -> Callable[..., None]:
    """Fails when GitLab's schema refuses a pipeline."""
    program = Path(sys.executable).parent / "check-jsonschema"
    options = ("--builtin-schema", "vendor.gitlab-ci", "--data-transform", "gitlab-ci")

    def judge(*files: Path) -> None:
        result = subprocess.run([program, *options, *files], capture_output=True, text=True, check=False)
        assert result.returncode == 0, result.stdout + result.stderr

    return judge
