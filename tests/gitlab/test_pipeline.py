"""The child pipeline: what GitLab makes of it, for any tests."""

import os
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.emit import render
from dodo_dsl.plan.model import Plan, Pooled, Suite
from dodo_dsl.plan.pipeline import JobOptions
from dodo_dsl.plan.pipeline import pipeline as planned
from tests.emit.readers import pipeline

OnRig = Callable[[str, str], Plan]


def text(*plans: Plan, gates: bool = True, folder: str = "generated", **options: Any) -> str:
    return render.render_pipeline(planned(Suite(plans, gates), Path(folder), JobOptions(**options))).text


def child(*plans: Plan, **given: Any) -> dict[str, Any]:
    return pipeline(text(*plans, **given))


def in_images(plan: Plan) -> Plan:
    """The same with a service that runs in a container alone."""
    (first, *others) = plan.application.services
    services = (replace(first, process=None), *others)
    return replace(plan, application=replace(plan.application, services=services))


def test_a_simulation_is_a_job(plan: Plan) -> None:
    job = child(plan)[plan.slug]
    assert (job["stage"], job["tags"], job["interruptible"]) == ("dodo-sil", ["sil"], True)
    assert job["rules"] == [{"when": "on_success"}]
    assert job["needs"] == [{"pipeline": "$DODO_PARENT_PIPELINE_ID", "job": "dodo-compile"}]
    assert (job["timeout"], job["artifacts"]["when"]) == ("11 minutes", "always")
    assert job["artifacts"]["reports"] == {"junit": "dodo-report/junit.xml", "metrics": "dodo-report/metrics.txt"}
    assert "resource_group" not in job
    assert child(plan)["default"]["retry"]["when"] == ["runner_system_failure", "stuck_or_timeout_failure"]


def test_hil_waits_for_a_gate_behind_all_others(plan: Plan, on_rig: OnRig) -> None:
    made = child(plan, replace(plan, slug="dil", level="dil"), on_rig("hil", "kiwi"))
    assert made["stages"] == ["dodo-sil", "dodo-dil", "dodo-gate", "dodo-hil"]
    assert "needs" not in made["dodo-gate"], "a job without needs waits for all stages before its own"
    assert (made["hil"]["needs"][1:], made["dil"]["needs"][1:]) == (["dodo-gate"], [])
    for made in (child(plan, on_rig("hil", "kiwi"), gates=False), child(on_rig("hil", "kiwi"))):
        assert "dodo-gate" not in {*made, *made["stages"]}
        assert len(made["hil"]["needs"]) == 1


def test_a_rig_is_for_one_test_at_a_time_and_never_cancelled(on_rig: OnRig) -> None:
    made = child(replace(on_rig("real", "kiwi"), more_tags=("rig-2",)), on_rig("model", "emulated"))
    assert (made["real"]["resource_group"], made["real"]["tags"]) == ("kiwi", ["hil-dynamic", "rig-2"])
    assert made["real"]["interruptible"] is False
    assert ("resource_group" in made["model"], made["model"]["tags"]) == (False, ["sil"])


def test_any_rig_of_a_pool_is_one_job_that_locks_none_of_them(on_rig: OnRig) -> None:
    pool = Pooled("hil", "hil")
    first, second = (
        replace(on_rig(f"hil--rig-{rig}", rig), name=f"hil[rig={rig}]", pool=pool, more_tags=(rig, "cellar"))
        for rig in ("kiwi-1", "kiwi-2")
    )
    made = child(first, second, folder="out")
    assert [name for name in made if "script" in made[name]] == ["hil"]
    assert (made["hil"]["tags"], made["hil"]["interruptible"]) == (["hil-dynamic", "cellar"], False)
    assert "resource_group" not in made["hil"]
    words = "--compiled out/hil--rig-kiwi-1 --compiled out/hil--rig-kiwi-2"
    assert made["hil"]["script"][1:] == [f"dodo run {words} --report dodo-report $DODO_RUN_OPTIONS"]


def test_all_jobs_but_those_on_rigs_run_as_the_parent_wants(plan: Plan, on_rig: OnRig) -> None:
    suite = (in_images(plan), on_rig("hil-model", "emulated"), on_rig("hil-real", "kiwi"))
    options: dict[str, Any] = {"tags": (), "image": 'dodo: "1"', "run_options": "--isolation host"}
    options |= {"services": ("docker:dind", {"name": "redis"}), "before_script": "a\nb"}
    made = child(*suite, **options)
    assert made["variables"] == {"DODO_RUN_OPTIONS": "--isolation host"}
    for name in (plan.slug, "hil-model"):
        assert made[name]["services"] == ["docker:dind", {"name": "redis"}]
        first, login = made[name]["before_script"]
        assert first == "a\nb" and "docker login" in login, "the engine that they wait for logs in"
    for name in (plan.slug, "hil-model", "dodo-gate"):
        assert (made[name]["image"], "tags" in made[name]) == ('dodo: "1"', False), name
    real = made["hil-real"]
    assert (real["tags"], {"image", "services"} & real.keys()) == (["hil-dynamic"], set())
    assert real["before_script"] == [login]
    assert child(*suite, tags=("big", "a, b"))["dodo-gate"]["tags"] == ["big", "a, b"]


def test_without_a_test_there_is_a_job_that_fails(tmp_path: Path) -> None:
    """GitLab refuses a pipeline without jobs. It passes where another project has the tests."""
    made = child()
    assert (made["dodo-no-tests"]["stage"], made["stages"]) == ("dodo-sil", ["dodo-sil"])
    for deployment, code in (("", 1), ("team/vehicle", 0)):
        script = "set -e\n" + "\n".join(made["dodo-no-tests"]["script"])
        result = subprocess.run(["sh", "-c", script], env={"DODO_DOWNSTREAM": deployment}, check=False)
        assert result.returncode == code


def test_images_that_were_built_are_what_is_tested(plan: Plan) -> None:
    """A variable DODO_RUN_OPTIONS of a project replaces the options of the parent, and not this one."""
    made = child(plan, folder="out", run_options="-v", images=("DODO_IMAGE_STEERING=steering:1",))
    expected = f"dodo run --compiled out/{plan.slug} --backend docker --report dodo-report $DODO_RUN_OPTIONS"
    assert made[plan.slug]["script"][1:] == [expected], "further options win"
    assert "docker login" in made[plan.slug]["before_script"][0]
    assert child(plan)[plan.slug]["before_script"] == [] and "docker" not in text(plan), "processes need no Docker"


def test_a_login_leaves_the_user_s_own_plugins_in_place(plan: Plan, tmp_path: Path) -> None:
    """Docker looks for Compose below DOCKER_CONFIG, which the login sets; a job that was killed has left its link."""
    plugin = tmp_path / ".docker/cli-plugins/docker-compose"
    plugin.parent.mkdir(parents=True)
    plugin.touch()
    (tmp_path / "docker").write_text("#!/bin/sh\ncat > /dev/null\n")
    (tmp_path / "docker").chmod(0o755)
    environment = {
        "PATH": f"{tmp_path}:{os.environ['PATH']}",
        "HOME": str(tmp_path),
        "CI_PROJECT_DIR": str(tmp_path / "project"),
        "CI_REGISTRY": "registry.example.org",
    }
    job = child(in_images(plan))[plan.slug]
    for step in ("before_script", "before_script", "after_script"):
        if step == "after_script":
            assert (tmp_path / "project.tmp/docker/cli-plugins/docker-compose").samefile(plugin)
        subprocess.run(["sh", "-ec", "\n".join(job[step])], env=environment, check=True)
    assert [path.name for path in plugin.parent.iterdir()] == ["docker-compose"]


def test_a_folder_is_one_word_to_the_shell(plan: Plan) -> None:
    _, line = child(plan, folder="out $(touch x)")[plan.slug]["script"]
    assert line.startswith(f"dodo run --compiled 'out $(touch x)/{plan.slug}' ")


@pytest.mark.thorough
def test_gitlab_accepts_it(plan: Plan, on_rig: OnRig, tmp_path: Path, accepted: Callable[..., None]) -> None:
    suite = (in_images(plan), on_rig("hil-real", "kiwi"), on_rig("hil-model", "emulated"))
    services = ("docker:dind", {"name": "redis"})
    (tmp_path / "plain.yml").write_text(text(plan))
    (tmp_path / "none.yml").write_text(text())
    (tmp_path / "all.yml").write_text(text(*suite, tags=(), image='dodo: "1"', services=services, before_script="a\nb"))
    accepted(*tmp_path.iterdir())


@pytest.mark.slow
def test_the_gate_keeps_needs_few(plan: Plan, on_rig: OnRig) -> None:
    plans = [replace(plan, slug=f"sil-{n}") for n in range(499)]
    assert len(child(*plans, on_rig("hil", "kiwi"))["hil"]["needs"]) == 2
