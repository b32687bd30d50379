"""DoDo's templates in pipelines of others, as gitlab-ci-local reads them: which jobs there are, and in which order."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.gitlab.inputs import TEMPLATES, included, listed, merged
from tests.gitlab.rules import KINDS
from tests.gitlab.test_local import PROGRAMS, commit, pipeline, run
from tests.gitlab.test_rules import FOREIGN, foreign

pytestmark = pytest.mark.slow

DEPLOYMENT = "  - local: .gitlab/dodo/deployment.gitlab-ci.yml\n"
APPLICATION = "  - local: .gitlab/dodo/application.gitlab-ci.yml\n"
Jobs = dict[str, str]
COMMON = {
    "dodo-check": "",
    "compile": "dodo-images",
    "dodo-pipeline": "compile",
    "dodo-tests": "dodo-pipeline",
    "dodo-report": "dodo-tests",
}
"""Each job with what it needs."""
IMAGES = {"dodo-images": ""}
STAGES = """\
stages: [build, test, release]
make: {stage: build, script: [make]}
upload: {stage: release, script: [make upload]}
"""
NO_TEST = """\
stages: [build, verify]
make: {stage: build, script: [make]}
.dodo: {stage: verify}
"""
MONOREPO = """\
stages: [test, tools]
tools: {stage: tools, script: [make], rules: [{changes: [tools/**/*]}]}
"""
COMPONENTS = """\
  - component: $CI_SERVER_FQDN/$CI_PROJECT_PATH/deployment@$CI_COMMIT_SHA
    inputs: &inputs {stage: verify, tags: [], image: "dodo-runner:1.0", run-options: --isolation host}
  - component: $CI_SERVER_FQDN/$CI_PROJECT_PATH/application@$CI_COMMIT_SHA
    inputs: *inputs
"""
INPUTS = """\
  - local: .gitlab/dodo/application.gitlab-ci.yml
    inputs: {stage: verify}
"""
ROBOT = """\
  - local: .gitlab/dodo/application.gitlab-ci.yml
    inputs: {compose-file: robots/kiwi/docker-compose.yml}
"""
NO_IMAGES = """\
  - local: .gitlab/dodo/application.gitlab-ci.yml
    inputs: {images: false}
"""
OWN_STAGE = """\
stages: [build, verify]
make: {stage: build, script: [make]}
"""
LINT = "lint: {script: [make lint]}\n"
AROUND = {"make": "build", "upload": "release"}
CASES: dict[str, tuple[str, str, Jobs, Jobs, str]] = {
    "own stages, an application": (APPLICATION, STAGES, AROUND, {**COMMON, **IMAGES}, "test"),
    "both": (DEPLOYMENT + APPLICATION, STAGES, AROUND, {**COMMON, **IMAGES}, "test"),
    "both the other way round, no stages": (
        APPLICATION + DEPLOYMENT,
        LINT,
        {"lint": "test"},
        {**COMMON, **IMAGES},
        "test",
    ),
    "a stage of its own": (DEPLOYMENT + APPLICATION, NO_TEST, {"make": "build"}, {**COMMON, **IMAGES}, "verify"),
    "a stage by an input": (INPUTS, OWN_STAGE, {"make": "build"}, {**COMMON, **IMAGES}, "verify"),
    "components with inputs": (COMPONENTS, OWN_STAGE, {"make": "build"}, {**COMMON, **IMAGES}, "verify"),
    "processes alone": (NO_IMAGES, LINT, {"lint": "test"}, {**COMMON, "compile": ""}, "test"),
    "a monorepo": (ROBOT, MONOREPO, {}, {**COMMON, **IMAGES}, "test"),
}


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    if not (PROGRAMS / "gitlab-ci-local").exists() or not shutil.which("rsync"):
        pytest.skip("gitlab-ci-local or rsync is not installed; scripts/install-gitlab-ci-local installs them")
    (tmp_path / ".gitlab/dodo").mkdir(parents=True)
    for template in TEMPLATES:
        shutil.copyfile(template, tmp_path / ".gitlab/dodo" / f"{template.parent.name}.gitlab-ci.yml")
        shutil.copytree(template.parent, tmp_path / "templates" / template.parent.name)
    for words in (["init", "-q", "-b", "main"], ["remote", "add", "origin", "git@gitlab.example.org:team/car.git"]):
        run(tmp_path, "git", *words)
    return tmp_path


def jobs(folder: Path, **variables: str) -> dict[str, dict[str, Any]]:
    """The jobs that would run in a pipeline with these variables, by name."""
    commit(folder)
    run(folder, "git", "update-ref", "refs/remotes/origin/main", "HEAD")
    words = [word for name, value in variables.items() for word in ("--variable", f"{name}={value}")]
    result = pipeline(folder, "--list-json", *words)
    assert result.returncode == 0, result.stdout + result.stderr
    listed = json.loads(result.stdout[result.stdout.index("[\n") :])
    return {job["name"]: job for job in listed if job["when"] != "never"}


FEW = ("both", "components with inputs")


@pytest.mark.parametrize("case", [c if c in FEW else pytest.param(c, marks=pytest.mark.proof) for c in CASES])
def test_the_jobs_are_there_and_foreign_ones_stay(case: str, repository: Path) -> None:
    includes, text, foreign, expected, stage = CASES[case]
    (repository / ".gitlab-ci.yml").write_text(f"include:\n{includes}{text}")
    found = jobs(repository, CI_PIPELINE_SOURCE="merge_request_event")
    assert {name: job["stage"] for name, job in found.items()} == {**foreign, **dict.fromkeys(expected, stage)}
    needs = {name: ",".join(need["job"] for need in found[name]["needs"] if need["job"] in found) for name in expected}
    assert needs == expected


def test_gitlab_accepts_them(tmp_path: Path, accepted: Callable[..., None]) -> None:
    for name, (includes, text, *_) in CASES.items():
        (tmp_path / f"{name}.yml").write_text(f"include:\n{includes}{text}")
    accepted(*tmp_path.iterdir())


SHORT = [("nightly", "schedule"), ("multi-project", "another project's pipeline")]
OTHERS = [("dind", kind) for kind in KINDS]
UNREAD = "include:\n  - template: Workflows/MergeRequest-Pipelines.gitlab-ci.yml\n"


@pytest.mark.parametrize(
    ("name", "kind"), [*SHORT, *(pytest.param(*other, marks=pytest.mark.proof) for other in OTHERS)]
)
def test_gitlab_ci_local_reads_rules_alike(name: str, kind: str, repository: Path) -> None:
    """DoDo's jobs; it makes all pipelines, as GitLab does with such a workflow as here."""
    config, inputs = foreign(name)
    inputs = {"rules": "merge-requests", **inputs}
    given = {key.replace("_", "-"): value for key, value in inputs.items()}
    templates = [f".gitlab/dodo/{template.parent.name}.gitlab-ci.yml" for template in TEMPLATES]
    include = yaml.safe_dump({"include": [{"local": local, "inputs": given} for local in templates]})
    text = FOREIGN[name].read_text().replace(UNREAD, "")
    (repository / ".gitlab-ci.yml").write_text(f"{include}{text}")
    around = {"workflow": {"rules": [{"when": "always"}]}}
    expected = listed(merged(*(included(template, **inputs) for template in TEMPLATES), around), KINDS[kind])
    found = {job.partition(":")[0] for job in jobs(repository, **{"CI_COMMIT_BRANCH": "", **KINDS[kind]})}
    assert found - config.keys() == expected
