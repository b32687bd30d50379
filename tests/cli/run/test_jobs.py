"""From a command line to jobs: clock, isolation, seed, wall timeout and repetition are inputs of what is built."""

import argparse
import io
from pathlib import Path

import pytest

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.main import parser
from dodo_dsl.cli.run.jobs import prepare
from dodo_dsl.plan.plan_json import from_json
from dodo_dsl.run.backends import Job
from dodo_dsl.spec.deployment.deployment import Deployment
from tests.check import examples

LOCKSTEP_ONLY = """\
clock: lockstep
action:
  vehicle: {uses: dynamic-model, with: {freq: 13 Hz}}
  pose: {uses: integrator}
"""
"""Wrong in lockstep alone: 13 Hz is not a multiple of the camera's rate."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    examples.write("clock: lockstep\n", tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def prepared(folder: Path, *words: str) -> tuple[list[Job], Deployment]:
    options: argparse.Namespace = parser().parse_args(["run", "example", "--report", str(folder / "report"), *words])
    return prepare(options, folder / "out", io.StringIO())


def test_a_changed_clock_replaces_what_was_wrong_in_the_first(folder: Path) -> None:
    examples.write(LOCKSTEP_ONLY, folder)
    with pytest.raises(UsageError):
        prepared(folder)
    jobs, _ = prepared(folder, "--clock", "realtime")
    assert jobs[0].plan.clock == "realtime"
    assert jobs[0].plan.lockstep is None
    assert "dodo-clock" not in {service.name for service in jobs[0].plan.services}


def test_a_changed_isolation_is_checked_and_built(folder: Path) -> None:
    jobs, _ = prepared(folder, "--isolation", "host")
    assert (jobs[0].plan.isolation, jobs[0].plan.subnet) == ("host", "")


def test_seed_and_wall_timeout_are_in_the_compiled_test_too(folder: Path) -> None:
    jobs, _ = prepared(folder, "--seed", "7", "--wall-timeout", "9")
    plan = jobs[0].plan
    assert plan.lockstep
    assert (plan.seed, plan.lockstep.wall_timeout_s) == (7, 9.0)
    assert from_json((jobs[0].folder / "test.json").read_text()) == plan


def test_repetitions_share_a_folder_and_differ_in_name(folder: Path) -> None:
    jobs, _ = prepared(folder, "--repeat", "3")
    assert [job.plan.name for job in jobs] == ["example", "example[run=2]", "example[run=3]"]
    assert [job.plan.slug for job in jobs] == ["example", "example--run-2", "example--run-3"]
    assert {job.test for job in jobs} == {"example"}
    assert len({job.folder for job in jobs}) == 1
    assert [job.report.name for job in jobs] == [job.plan.slug for job in jobs]


@pytest.fixture
def compiled(folder: Path) -> Path:
    """A compiled test beside a deployment."""
    jobs, _ = prepared(folder)
    (folder / "dodo.yml").write_text((folder / "dodo.yml").read_text() + "cids: 200-203\nsubnets: 10.9.0.0/24\n")
    return jobs[0].folder


def run_compiled(folder: Path, compiled: Path, *words: str) -> tuple[list[Job], Deployment]:
    flags = ["run", "--compiled", str(compiled), "--report", str(folder / "report"), *words]
    return prepare(parser().parse_args(flags), folder / "unused", io.StringIO())


def test_a_compiled_test_takes_cids_and_subnets_from_the_deployment(folder: Path, compiled: Path) -> None:
    _, deployment = run_compiled(folder, compiled)
    assert list(deployment.cids) == [200, 201, 202, 203]
    assert str(deployment.subnets) == "10.9.0.0/24"


def test_a_compiled_test_refuses_a_deployment_with_errors(folder: Path, compiled: Path) -> None:
    (folder / "dodo.yml").write_text("dodo: 1\ncids: 300\n")
    with pytest.raises(UsageError, match=r"dodo\.yml"):
        run_compiled(folder, compiled)


def test_a_compiled_test_takes_seed_wall_timeout_and_repetitions(folder: Path, compiled: Path) -> None:
    jobs, _ = run_compiled(folder, compiled, "--seed", "5", "--wall-timeout", "4", "--repeat", "2")
    assert [job.plan.seed for job in jobs] == [5, 5]
    assert [job.plan.lockstep.wall_timeout_s for job in jobs if job.plan.lockstep] == [4.0, 4.0]
    assert [job.plan.slug for job in jobs] == ["example", "example--run-2"]


def test_a_compiled_test_keeps_its_clock(folder: Path, compiled: Path) -> None:
    with pytest.raises(UsageError, match="compiled for clock lockstep"):
        run_compiled(folder, compiled, "--clock", "realtime")


def test_git_ignores_a_new_report_folder_but_no_other(folder: Path) -> None:
    prepared(folder)
    assert (folder / "report/.gitignore").read_text() == "*\n"
    (folder / "report/.gitignore").unlink()
    prepared(folder)
    assert not (folder / "report/.gitignore").exists()
