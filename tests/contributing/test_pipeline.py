"""DoDo's own pipeline: GitLab takes it, and it runs what CONTRIBUTING tells people to run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
FILE = ROOT / ".gitlab-ci.yml"
PIPELINE = yaml.safe_load(FILE.read_text())
JOBS = {name: f"make {name}" for name in ("check", "test", "proof")}


def test_gitlab_accepts_it() -> None:
    program = Path(sys.executable).parent / "check-jsonschema"
    options = ("--builtin-schema", "vendor.gitlab-ci", "--data-transform", "gitlab-ci")
    result = subprocess.run([program, *options, FILE], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("job", JOBS)
def test_each_job_is_a_target_of_the_makefile(job: str) -> None:
    assert PIPELINE[job]["script"] == [JOBS[job]]
    target = JOBS[job].removeprefix("make ")
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert f"    {JOBS[job]} " in (ROOT / "CONTRIBUTING.md").read_text()


def test_reports_are_kept_of_failed_jobs_too() -> None:
    artifacts = PIPELINE["default"]["artifacts"]
    assert artifacts["when"] == "always" and artifacts["expire_in"]
    folder = artifacts["paths"][0].rstrip("/")
    assert artifacts["reports"] == {"junit": f"{folder}/*.xml"}
    makefile = (ROOT / "Makefile").read_text()
    assert f"JUNIT := {folder}\n" in makefile
    assert makefile.count("$(PYTEST)") == makefile.count("--junitxml=$(JUNIT)/"), "each part writes its own report"
    assert not any("artifacts" in PIPELINE[job] for job in JOBS), "jobs must not replace the default's artifacts"


def test_the_image_is_a_variable_and_no_host_is_named() -> None:
    assert PIPELINE["default"]["image"] == "$DODO_CI_IMAGE" and "DODO_CI_IMAGE" in PIPELINE["variables"]
    assert not re.findall(r"https?://|[a-z0-9-]+\.(?:com|org|io|net)\b", FILE.read_text())
