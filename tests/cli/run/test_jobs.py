"""From a command line to jobs: clock, isolation, seed, wall timeout and repetition are inputs of what is built."""

import argparse
import io
import shutil
from pathlib import Path

import pytest

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.main import parser
from dodo_dsl.cli.run_jobs import prepare
from dodo_dsl.emit.render import PLAN_FILE
from dodo_dsl.plan.plan_json import from_json
from dodo_dsl.run.backends import Job
from dodo_dsl.spec.deployment import Deployment
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


def on_pool(folder: Path, more: str = "") -> None:
    """The test runs on any of two rigs."""
    examples.write(f"level: hil\nrig: static\n{more}", folder)
    rigs = "{b: {kind: static, cid: 121, camera: {source: b}}, a: {kind: static, cid: 122, camera: {source: a}}}"
    path = folder / "dodo.yml"
    path.write_text(f"{path.read_text()}rigs: {rigs}\n")


def test_any_rig_of_a_pool_is_one_job(folder: Path) -> None:
    """The compiled folders are those of the instances; name, report and history are the test's."""
    on_pool(folder)
    jobs, _ = prepared(folder, "--repeat", "2")
    assert [(job.plan.slug, job.report.name, job.test, job.plan.rig) for job in jobs] == [
        ("example", "example", "example", "a"),
        ("example--run-2", "example--run-2", "example", "a"),
    ]
    for job in jobs:
        (other,) = job.others
        assert (other.plan.rig, other.plan.slug, other.report) == ("b", job.plan.slug, job.report)
        assert [one.folder.name for one in (job, other)] == ["example--rig-a", "example--rig-b"]


def test_samples_on_any_rig_of_a_pool_are_a_job_each(folder: Path) -> None:
    vary = "vary: {wait: {from: 40 s, to: 50 s, nominal: 40 s}}\n"
    track = "evaluation:\n  track: {uses: collision, with: {goal: finish, max-time: '${vary.wait}'}}\n"
    on_pool(folder, vary + track)
    jobs, _ = prepared(folder, "--samples", "2")
    assert [(job.plan.slug, job.test, job.plan.rig, [other.plan.rig for other in job.others]) for job in jobs] == [
        ("example--sample-1", "example", "a", ["b"]),
        ("example--sample-2", "example", "a", ["b"]),
    ]
    assert [job.plan.name.startswith("example[sample=") and "rig" not in job.plan.name for job in jobs] == [True, True]


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


def test_several_compiled_tests_run_together(folder: Path, compiled: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(compiled, other)
    (other / "test.json").write_text((other / "test.json").read_text().replace('"slug": "example"', '"slug": "other"'))
    jobs, _ = run_compiled(folder, compiled, "--compiled", str(other))
    assert [(job.plan.slug, job.folder) for job in jobs] == [("example", compiled), ("other", other)]
    with pytest.raises(UsageError, match="one of them twice"):
        run_compiled(folder, compiled, "--compiled", str(compiled))


def test_a_compiled_test_keeps_its_clock(folder: Path, compiled: Path) -> None:
    with pytest.raises(UsageError, match="compiled for clock lockstep"):
        run_compiled(folder, compiled, "--clock", "realtime")


def test_git_ignores_a_new_report_folder_but_no_other(folder: Path) -> None:
    prepared(folder)
    assert (folder / "report/.gitignore").read_text() == "*\n"
    (folder / "report/.gitignore").unlink()
    prepared(folder)
    assert not (folder / "report/.gitignore").exists()


VARIED = """\
seed: 5
matrix: {side: [1, 2]}
vary: {start: {from: -2 cm, to: 2 cm, nominal: 0 cm}}
action:
  vehicle: {uses: dynamic-model}
  pose: {uses: integrator, with: {freq: 100 Hz, x: "${vary.start}", y: "${matrix.side} m"}}
"""


def test_samples_of_a_test_are_the_same_for_one_seed_and_within_its_ranges(folder: Path) -> None:
    examples.write(VARIED, folder)
    jobs, _ = prepared(folder, "--samples", "3")
    assert [job.plan.slug for job in jobs] == [
        f"example--side-{side}--sample-{number}" for side in (1, 2) for number in (1, 2, 3)
    ]
    assert [job.test for job in jobs] == ["example--side-1"] * 3 + ["example--side-2"] * 3
    starts = [{f.name: f.value for s in job.plan.services for f in s.flags if s.name == "pose"}["x"] for job in jobs]
    assert starts[:3] == starts[3:]
    assert len(set(starts)) == 3
    assert all(-0.02 <= float(start) <= 0.02 for start in starts)
    shown = [job.plan.name.partition("start=")[2].removesuffix(" cm]") for job in jobs]
    assert [float(one) / 100 for one in shown] == pytest.approx([float(start) for start in starts])
    compiled = [from_json((job.folder / PLAN_FILE).read_text()).name for job in jobs]
    assert compiled == [job.plan.name for job in jobs]
    again, _ = prepared(folder, "--samples", "3", "--seed", "6")
    assert {job.plan.name for job in again}.isdisjoint(job.plan.name for job in jobs)


def test_samples_need_a_range(folder: Path) -> None:
    with pytest.raises(UsageError, match="none of these has 'vary'"):
        prepared(folder, "--samples", "3")


def test_a_compiled_test_without_its_shared_files_is_not_run(folder: Path) -> None:
    prepared(folder)
    path = folder / "out/example" / PLAN_FILE
    path.write_text(path.read_text().replace('"shared": {}', f'"shared": {{"a.rec": "{"0" * 64}-a.rec"}}'))
    with pytest.raises(UsageError, match=r"example: 'a\.rec' is missing: .* beside the compiled tests"):
        run_compiled(folder, path.parent)


DRIVER = """\
# docker-compose.yml
services:
  driver:
    image: driver
    command: --cid=111
    x-dodo: {out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]}
    x-dodo-process: [python, driver.py]
# dodo.yml
registry: [tests, "dodo:"]
"""
ON_THE_RIG = ["hil-closed-oval", "hil-dynamic", "hil-open-straight"]
RIGLESS = "skipped shipped tests that need a rig, which dodo.yml does not have: "


@pytest.fixture
def shipped(folder: Path) -> Path:
    """A deployment of the shipped tests."""
    examples.write(DRIVER, folder)
    (folder / "driver.py").touch()
    return folder


def selected(folder: Path, *words: str) -> tuple[list[str], str]:
    """The tests that run, and what is said about others."""
    said = io.StringIO()
    options = parser().parse_args(["run", "--report", str(folder / "report"), *words])
    jobs, _ = prepare(options, folder / "out", said)
    return sorted(job.test for job in jobs), said.getvalue()


@pytest.mark.thorough
def test_those_that_nobody_named_are_left_out(shipped: Path) -> None:
    names, said = selected(shipped, "--level", "sil", "--level", "hil")
    assert f"{RIGLESS}{', '.join(ON_THE_RIG)} (--emulate" in said and "sil-closed-straight" in names
    assert not set(ON_THE_RIG) & set(names)
    assert set(ON_THE_RIG) <= set(selected(shipped, "--level", "hil", "--emulate")[0])
    assert selected(shipped, "hil-dynamic") == (["hil-dynamic"], "")


@pytest.mark.thorough
def test_each_test_is_in_one_part(shipped: Path) -> None:
    """With all of its repetitions."""
    parts = [selected(shipped, "sil-closed-*", "--repeat", "2", "--shard", f"{part}/3")[0] for part in (1, 2, 3)]
    every = selected(shipped, "sil-closed-*")[0]
    assert len(every) > 3 and sorted(name for part in parts for name in part) == sorted(2 * every)
    assert not set(parts[0]) & set(parts[1]) and all(map(set, parts))
    few = selected(shipped, "sil-closed-straight", "--shard", "2/2")
    assert few[0] == []
