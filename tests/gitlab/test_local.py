"""A pipeline as a runner runs it: gitlab-ci-local with the deployment's template, its artifact, its child, real tests.

It ends with 0 whatever a child ends with, so that the child is run by its own file too.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.report.joined.gitlab_api import serving

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
PROGRAMS = CACHE / "dodo/gitlab-ci-local/node_modules/.bin"
FOREIGN = """\
include:
  - local: .gitlab/dodo/tests.gitlab-ci.yml
    inputs:
      compose-file: kiwi/docker-compose.yml
      needs: [configure]
      before-script: echo "before $CI_JOB_NAME${OURS:+ with what is ours}"
      variables: [DODO_RUN_OPTIONS]
stages: [prepare, test, release]
default: {before_script: [echo of foreign jobs only]}
variables: {DODO_RUN_OPTIONS: "", GIT_STRATEGY: none, OURS: "1"}
configure: {stage: prepare, script: [echo configured]}
compile: {script: [echo compiled]}
publish: {stage: release, script: [echo published]}
"""
"""In a pipeline with stages, jobs and defaults of its own."""
NO_TAGS = ("#/definitions/tags/minItems", "#/additionalProperties")
"""What GitLab allows and the schema in gitlab-ci-local does not."""
ONE_JOB = """\
include:
  - local: .gitlab/dodo/run.gitlab-ci.yml
    inputs: {run-options: -j 1}
variables: {}
dodo-run: {parallel: 2}
"""
TESTS = ("sil-closed-left-curve", "sil-closed-straight")


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository with two of the shipped simulations, the example application, and a pipeline around DoDo's jobs."""
    if not (PROGRAMS / "gitlab-ci-local").exists() or not shutil.which("rsync"):
        pytest.skip("gitlab-ci-local or rsync is not installed; scripts/install-gitlab-ci-local installs them")
    skipped = shutil.ignore_patterns("__pycache__")
    for name in ("maps", *TESTS):
        shutil.copytree(ROOT / "tests_registry" / name, tmp_path / "tests" / name, ignore=skipped)
    shutil.copytree(ROOT / "examples/kiwi", tmp_path / "kiwi", ignore=skipped)
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: kiwi/docker-compose.yml\n")
    run(tmp_path, sys.executable, "-m", "dodo_dsl", "new", "--deployment")
    for words in (["init", "-q", "-b", "main"], ["remote", "add", "origin", "git@gitlab.example.org:team/tests.git"]):
        run(tmp_path, "git", *words)
    (tmp_path / ".gitlab-ci.yml").write_text(FOREIGN)
    commit(tmp_path)
    return tmp_path


def commit(folder: Path) -> None:
    run(folder, "git", "add", "-A")
    run(folder, "git", "-c", "user.name=Test", "-c", "user.email=test@example.org", "commit", "-qm", "Change")


def run(folder: Path, *command: str) -> None:
    subprocess.run(command, cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True, capture_output=True)


def pipeline(folder: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """gitlab-ci-local with the `dodo` of these tests' environment; its state stays in the repository's folder."""
    path = os.pathsep.join([str(PROGRAMS), str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "DODO_LEASES": str(folder / ".leases")}
    allowed = [word for path in NO_TAGS for word in ("--ignore-schema-paths", path)]
    command = ["gitlab-ci-local", "--home", str(folder / ".home"), "--concurrency", "1", "--force-shell-executor"]
    command += [*allowed, *words]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=900
    )


def artifact(folder: Path, job: str, name: str) -> Path:
    return folder / ".gitlab-ci-local/artifacts" / job / name


def test_the_parent_compiles_and_the_child_runs_every_test(repository: Path) -> None:
    with serving(repository / ".gitlab-ci-local/artifacts") as api:
        variables = api.environment(CI_JOB_URL="https://gitlab.example.org/-/jobs/5").items()
        result = pipeline(
            repository, *(word for name, value in variables for word in ("--variable", f"{name}={value}"))
        )
    assert result.returncode == 0, result.stdout[-4000:] + result.stderr[-2000:]
    assert (repository / "gl-code-quality-report.json").read_text().strip() == "[]"
    assert artifact(repository, "dodo-pipeline", "generated/child.gitlab-ci.yml").is_file()
    plain = re.sub(r"\x1b\[[0-9;]*m", "", result.stdout)
    said = re.findall(r"^(?:\t\[dodo-tests\] -> )?([\w-]+) +> *(.*)", plain, re.MULTILINE)
    foreign = {name for name, words in said if "of foreign jobs only" in words}
    assert foreign == {"configure", "compile", "publish"}
    before = {name for name, words in said if words == f"before {name}"}
    assert before >= {"dodo-compile", *TESTS}, "all jobs with a script, also of the child, and without OURS"
    for name in TESTS:
        (case,) = ElementTree.parse(artifact(repository, name, "dodo-report/junit.xml")).iter("testcase")
        assert (case.get("name"), case.get("classname")) == (name, "sil")
        assert [child.tag for child in case if child.tag in ("failure", "error", "skipped")] == [], result.stdout[
            -4000:
        ]
        assert artifact(repository, name, "dodo-report/metrics.txt").is_file()
    joined = artifact(repository, "dodo-report", "dodo-report")
    cases = ElementTree.parse(joined / "junit.xml").iter("testcase")
    assert [case.get("name") for case in cases] == list(TESTS), result.stdout[-4000:]
    assert all((joined / name / "drive.html").is_file() for name in TESTS)


def steer_the_other_way(repository: Path) -> None:
    """The application hits a wall."""
    steering = repository / "kiwi/steering.py"
    right, wrong = "groundSteering=", "groundSteering=-"
    assert right in steering.read_text()
    steering.write_text(steering.read_text().replace(right, wrong))
    commit(repository)


def test_a_failing_application_fails_its_job(repository: Path) -> None:
    """The exit code says so; the report is kept."""
    steer_the_other_way(repository)
    run(repository, sys.executable, "-m", "dodo_dsl", "compile")
    child = repository / "generated/child.gitlab-ci.yml"
    words = ("--file", str(child.relative_to(repository)), "--variable", "DODO_PARENT_PIPELINE_ID=1")
    result = pipeline(repository, *words)
    assert result.returncode == 1, result.stdout[-4000:] + result.stderr[-2000:]
    assert "FAIL" in result.stdout
    (case,) = ElementTree.parse(artifact(repository, TESTS[1], "dodo-report/junit.xml")).iter("testcase")
    assert "wall" in str(case.find("failure").get("message"))  # type: ignore[union-attr]


@pytest.mark.proof
def test_and_so_do_jobs_that_share_the_tests(repository: Path) -> None:
    steer_the_other_way(repository)
    (repository / ".gitlab-ci.yml").write_text(ONE_JOB)
    commit(repository)
    result = pipeline(repository)
    assert result.returncode == 1, result.stdout[-4000:] + result.stderr[-2000:]
    written = (repository / ".gitlab-ci-local/artifacts").glob("*/dodo-report/junit.xml")
    cases = [[case.get("name") for case in ElementTree.parse(path).iter("testcase")] for path in written]
    assert sorted(cases) == [[name] for name in TESTS], "a part each"


def test_dodo_s_own_pipeline_has_the_component_of_the_checkout(repository: Path) -> None:
    """As gitlab-ci-local finds it, whose host and project are those of the remote; a tag is released behind it."""
    shutil.copy(ROOT / ".gitlab-ci.yml", repository)
    shutil.copytree(ROOT / "templates/run", repository / "templates/run")
    commit(repository)
    words = ("CI_PIPELINE_SOURCE=push", "CI_COMMIT_TAG=0.2.0")
    result = pipeline(repository, "--list-csv", *(word for text in words for word in ("--variable", text)))
    assert result.returncode == 0, result.stdout + result.stderr
    lines = [line.split(";") for line in result.stdout.splitlines() if ";" in line]
    assert [line[0] for line in lines[1:]] == ["smoke", "check", "test", "release"]
