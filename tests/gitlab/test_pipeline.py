"""The child pipeline: what its jobs say, and what GitLab would refuse of it."""

import os
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from dodo_dsl.emit.pipeline import artifact_problems, pipeline_problems
from dodo_dsl.emit.pipeline_jobs import NO_OPTIONS, JobOptions

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.emit import pipeline as emitted
from dodo_dsl.emit import render
from dodo_dsl.emit.render import File
from dodo_dsl.plan.build import Compiled
from dodo_dsl.plan.model import Plan, Pooled, Suite
from dodo_dsl.plan.test_files import FileCopy
from tests.emit.readers import pipeline

OnRig = Callable[[str, str], Plan]


def render_pipeline(suite: Suite, folder: str, options: JobOptions = NO_OPTIONS) -> File:
    return render.render_pipeline(emitted.pipeline(suite, folder, options))


def child(*plans: Plan, gates: bool = True, folder: str = "generated") -> dict[str, Any]:
    return pipeline(render_pipeline(Suite(plans, gates), folder).text)


def problems(*plans: Plan, options: JobOptions = NO_OPTIONS) -> list[Diagnostic]:
    return list(pipeline_problems(Suite(plans), emitted.pipeline(Suite(plans), "generated", options)))


def test_a_simulation_is_a_job(plan: Plan) -> None:
    job = child(plan)[plan.slug]
    assert (job["stage"], job["tags"], job["interruptible"]) == ("sil", ["sil"], True)
    assert job["rules"] == [{"when": "on_success"}]
    assert job["needs"] == [{"pipeline": "$PARENT_PIPELINE_ID", "job": "compile"}]
    assert job["timeout"] == "11 minutes"
    assert job["artifacts"]["when"] == "always"
    assert job["artifacts"]["reports"] == {"junit": "dodo-report/junit.xml", "metrics": "dodo-report/metrics.txt"}
    assert "resource_group" not in job


def test_hil_waits_for_a_gate_behind_all_others(plan: Plan, on_rig: OnRig) -> None:
    made = child(plan, replace(plan, slug="dil", level="dil"), on_rig("hil", "kiwi"))
    assert made["stages"] == ["sil", "dil", "gate", "hil"]
    assert "needs" not in made["gate"], "a job without needs waits for all stages before its own"
    assert made["hil"]["needs"][1:] == ["gate"]
    assert made["dil"]["needs"][1:] == []


def test_without_gates_or_others_hil_waits_for_nothing(plan: Plan, on_rig: OnRig) -> None:
    for made in (child(plan, on_rig("hil", "kiwi"), gates=False), child(on_rig("hil", "kiwi"))):
        assert "gate" not in made
        assert "gate" not in made["stages"]
        assert len(made["hil"]["needs"]) == 1


def test_a_rig_is_for_one_test_at_a_time_and_never_cancelled(on_rig: OnRig) -> None:
    made = child(on_rig("real", "kiwi"), on_rig("model", "emulated"))
    assert (made["real"]["resource_group"], made["real"]["tags"]) == ("kiwi", ["hil-dynamic"])
    assert made["real"]["interruptible"] is False
    assert "resource_group" not in made["model"]
    assert made["model"]["tags"] == ["sil"]


def test_more_tags_of_a_rig_tell_its_runner_from_others(on_rig: OnRig) -> None:
    made = child(replace(on_rig("real", "kiwi"), more_tags=("rig-2",)))
    assert made["real"]["tags"] == ["hil-dynamic", "rig-2"]


@pytest.mark.thorough
def test_any_rig_of_a_pool_is_one_job_that_locks_none_of_them(
    on_rig: OnRig, tmp_path: Path, accepted: Callable[..., None]
) -> None:
    pool = Pooled("hil", "hil")
    first, second = (
        replace(on_rig(f"hil--rig-{rig}", rig), name=f"hil[rig={rig}]", pool=pool, more_tags=(rig, "cellar"))
        for rig in ("kiwi-1", "kiwi-2")
    )
    suite = Suite((first, second, replace(first, slug="hil-2--rig-kiwi-1", pool=Pooled("hil-2", "hil-2"))))
    text = render_pipeline(suite, "out").text
    (tmp_path / "child.yml").write_text(text)
    accepted(tmp_path / "child.yml")
    made = pipeline(text)
    assert [name for name in made if "script" in made[name]] == ["hil", "hil-2"]
    assert (made["hil"]["tags"], made["hil"]["interruptible"]) == (["hil-dynamic", "cellar"], False)
    assert "resource_group" not in made["hil"]
    words = "--compiled out/hil--rig-kiwi-1 --compiled out/hil--rig-kiwi-2"
    assert made["hil"]["script"] == [f"dodo run {words} --report dodo-report $DODO_RUN_OPTIONS"]
    assert made["hil-2"]["tags"] == ["hil-dynamic", "kiwi-1", "cellar"]
    packed = pipeline(render_pipeline(suite, "out", JobOptions(most_jobs=1)).text)
    assert [name for name in packed if "script" in packed[name]] == ["hil", "hil-2"], "pools of other rigs do not mix"
    again = replace(second, slug="hil-3--rig-kiwi-2", pool=Pooled("hil-3", "hil-3"))
    both = Suite((first, second, replace(first, slug="hil-3--rig-kiwi-1", pool=again.pool), again))
    packed = pipeline(render_pipeline(both, "out", JobOptions(most_jobs=1)).text)
    assert packed["rig kiwi-1 or kiwi-2"]["script"][0].endswith(" --jobs 1")


def test_only_failures_of_runners_are_tried_again(plan: Plan) -> None:
    assert child(plan)["default"]["retry"]["when"] == ["runner_system_failure", "stuck_or_timeout_failure"]


def test_tests_of_images_log_in_to_the_registry(plan: Plan) -> None:
    (first, *others) = plan.application.services
    services = (replace(first, process=None), *others)
    made = child(replace(plan, application=replace(plan.application, services=services)))
    assert made["variables"] == {"DODO_REGISTRY": "$CI_REGISTRY"}
    assert "variables" not in child(plan)
    assert "--password-stdin" in made["default"]["before_script"][0]


@pytest.mark.thorough
def test_all_jobs_but_those_on_rigs_run_as_the_parent_wants(
    plan: Plan, on_rig: OnRig, tmp_path: Path, accepted: Callable[..., None]
) -> None:
    suite = Suite((plan, on_rig("hil-model", "emulated"), on_rig("hil-real", "kiwi")))
    options = JobOptions((), 'dodo: "1"', "--isolation host")
    text = render_pipeline(suite, "generated", options).text
    (tmp_path / "child.yml").write_text(text)
    accepted(tmp_path / "child.yml")
    made = pipeline(text)
    assert made["variables"] == {"DODO_RUN_OPTIONS": "--isolation host"}
    assert (made["hil-real"]["tags"], "image" in made["hil-real"]) == (["hil-dynamic"], False)
    for name in (plan.slug, "hil-model", "gate"):
        assert (made[name]["image"], "tags" in made[name]) == ('dodo: "1"', False), name
    tagged = pipeline(render_pipeline(suite, "generated", JobOptions(("big", "a, b"))).text)
    assert tagged["gate"]["tags"] == tagged["hil-model"]["tags"] == ["big", "a, b"]
    assert "image" not in tagged["gate"] and "variables" not in tagged


def test_what_jobs_of_tests_have_in_common_stands_once(plan: Plan, on_rig: OnRig) -> None:
    """But for what a job on a rig could not do without, as it inherits all that it does not replace."""
    options = JobOptions(("big",), "image", services=("docker:dind",), before_script="begin")
    suite = Suite((plan, on_rig("hil-real", "kiwi")))
    made = yaml.safe_load(render_pipeline(suite, "generated", options).text)
    own, for_all = {"extends", "stage", "timeout", "script"}, {"rules", "needs", "interruptible", "artifacts"}
    assert made[plan.slug].keys() == own
    assert made[".dodo-test"].keys() == for_all | {"tags", "image", "services", "before_script"}
    assert made[".dodo-rig"].keys() == for_all
    assert made["hil-real"].keys() == own | {"tags", "needs", "resource_group"}


@pytest.mark.thorough
def test_services_and_first_commands_are_for_all_jobs_but_those_on_rigs(
    plan: Plan, on_rig: OnRig, tmp_path: Path, accepted: Callable[..., None]
) -> None:
    options = JobOptions(services=("docker:dind", {"name": "redis"}), before_script="a\nb", artifacts_access="none")
    suite = Suite((plan, on_rig("hil-model", "emulated"), on_rig("hil-real", "kiwi")))
    text = render_pipeline(suite, "generated", options).text
    (tmp_path / "child.yml").write_text(text)
    accepted(tmp_path / "child.yml")
    made = pipeline(text)
    for name in (plan.slug, "hil-model"):
        assert made[name]["services"] == ["docker:dind", {"name": "redis"}]
        login = made["default"]["before_script"]
        assert made[name]["before_script"] == ["a\nb", *login], "the engine that they wait for logs in"
    assert not {"services", "before_script"} & made["hil-real"].keys() and len(made["hil-real"]["script"]) == 1
    assert "services" not in made["gate"] and made["gate"]["before_script"] == [], "whatever a parent forwards"
    assert {job["artifacts"]["access"] for job in made.values() if "artifacts" in job} == {"none"}
    plain = render_pipeline(suite, "generated").text
    assert "services" not in plain and "access" not in plain


@pytest.mark.thorough
def test_without_a_test_there_is_a_job_that_says_so(tmp_path: Path, accepted: Callable[..., None]) -> None:
    """GitLab refuses a pipeline without jobs, and the parent decides whether it comes to this one."""
    text = render_pipeline(Suite(()), "generated").text
    (tmp_path / "child.yml").write_text(text)
    accepted(tmp_path / "child.yml")
    made = pipeline(text)
    assert (made["no-tests"]["stage"], made["stages"]) == ("test", ["test"])


def test_images_that_were_built_are_what_is_tested(plan: Plan) -> None:
    """A variable DODO_RUN_OPTIONS of a project replaces the options of the parent, and not this one."""

    def child(*given: Any) -> Any:
        return pipeline(render_pipeline(Suite((plan,)), "out", JobOptions(("sil",), "", *given)).text)

    assert "variables" not in child() and "--backend" not in child()[plan.slug]["script"][0]
    made = child("-v", ("DODO_IMAGE_STEERING=steering:1",))
    assert made["variables"] == {"DODO_REGISTRY": "$CI_REGISTRY", "DODO_RUN_OPTIONS": "-v"}
    expected = f"dodo run --compiled out/{plan.slug} --backend docker --report dodo-report $DODO_RUN_OPTIONS"
    assert made[plan.slug]["script"] == [expected], "further options win"


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
        "DODO_REGISTRY": "registry.example.org",
    }
    default = pipeline(render_pipeline(Suite((plan,)), "generated").text)["default"]
    for step in ("before_script", "before_script", "after_script"):
        if step == "after_script":
            assert (tmp_path / "project.tmp/docker/cli-plugins/docker-compose").samefile(plugin)
        subprocess.run(["sh", "-ec", "\n".join(default[step])], env=environment, check=True)
    assert [path.name for path in plugin.parent.iterdir()] == ["docker-compose"]


@pytest.mark.thorough
def test_packed_tests_share_jobs(plan: Plan, on_rig: OnRig, tmp_path: Path, accepted: Callable[..., None]) -> None:
    plans = [replace(plan, slug=f"sil-{n}") for n in range(5)] + [replace(plan, slug="dil-0", level="dil")]
    rigs = [on_rig("hil-a", "kiwi"), on_rig("hil-b", "kiwi"), on_rig("hil-c", "other"), on_rig("hil-d", "emulated")]
    suite, options = Suite((*plans, *rigs)), JobOptions(most_jobs=2)
    text = render_pipeline(suite, "generated", options).text
    (tmp_path / "child.yml").write_text(text)
    accepted(tmp_path / "child.yml")
    made = pipeline(text)
    assert [name for name in made if "script" in made[name]] == [
        "gate", "tests 1/2", "tests 2/2", "rig kiwi", "hil-c", "hil-d"
    ]  # fmt: skip
    assert made["tests 1/2"]["script"] == [
        "dodo run --compiled generated/sil-0 --compiled generated/sil-2 --compiled generated/sil-4 "
        "--report dodo-report $DODO_RUN_OPTIONS"
    ]
    assert (made["tests 1/2"]["stage"], made["tests 2/2"]["stage"]) == ("sil", "dil")
    assert made["tests 1/2"]["timeout"] == "13 minutes", "a minute a test, and the same to spare"
    rig = made["rig kiwi"]
    assert (rig["resource_group"], rig["tags"], rig["interruptible"]) == ("kiwi", ["hil-dynamic"], False)
    assert rig["script"] == [
        "dodo run --compiled generated/hil-a --compiled generated/hil-b --report dodo-report $DODO_RUN_OPTIONS --jobs 1"
    ]
    assert rig["needs"][1:] == ["gate"] and made["stages"] == ["sil", "dil", "gate", "hil"]
    assert problems(*(replace(plan, slug=f"sil-{n}") for n in range(900)), options=JobOptions(most_jobs=9)) == []


def test_a_folder_is_one_word_to_the_shell(plan: Plan) -> None:
    (line,) = child(plan, folder="out $(touch x)")[plan.slug]["script"]
    assert line.startswith(f"dodo run --compiled 'out $(touch x)/{plan.slug}' ")


@pytest.mark.thorough
def test_gitlab_accepts_it(plan: Plan, on_rig: OnRig, tmp_path: Path, accepted: Callable[..., None]) -> None:
    suite = Suite((plan, on_rig("hil-real", "kiwi"), on_rig("hil-model", "emulated")))
    file = render_pipeline(suite, "generated")
    (tmp_path / file.path).write_text(file.text)
    accepted(tmp_path / file.path)


def test_a_common_pipeline_has_no_problem(plan: Plan) -> None:
    assert problems(*(replace(plan, slug=f"{plan.slug}--n-{n}") for n in range(500))) == []


@pytest.mark.parametrize(
    ("number", "said"),
    [(501, "501 jobs, gitlab.com allows 500 on its free tier"), (1701, "1701 jobs, which take more than the 2 MB")],
)
def test_many_jobs_are_a_warning_at_the_test_with_most_instances(plan: Plan, number: int, said: str) -> None:
    small = replace(plan, spec="small/small.dodo.yml", slug="small")
    many = [replace(plan, slug=f"{plan.slug}--n-{n}") for n in range(number - 1)]
    (problem,) = problems(small, *many)
    assert (problem.severity, problem.span.file) == ("warning", plan.spec)
    assert said in problem.message
    assert problem.message.endswith(f"({number - 1} of this test)")


@pytest.mark.slow
def test_the_gate_counts_and_needs_stay_few(plan: Plan, on_rig: OnRig) -> None:
    plans = [replace(plan, slug=f"sil-{n}") for n in range(499)]
    assert problems(*plans, replace(plan, slug="last")) == []
    (problem,) = problems(*plans, on_rig("hil", "kiwi"))
    assert "has 501 jobs" in problem.message
    assert len(child(*plans, on_rig("hil", "kiwi"))["hil"]["needs"]) == 2


def test_an_artifact_over_the_limit_is_a_warning_that_names_the_largest_files(plan: Plan, tmp_path: Path) -> None:
    """Shared files count once, and those of the repository not at all."""
    for name, size in (("small", 1), ("large", 60), ("linked", 900)):
        with (tmp_path / name).open("wb") as file:
            file.truncate(size << 20)
    small, large, linked = (FileCopy(name, tmp_path / name) for name in ("small", "large", "linked"))
    other = replace(plan, slug="other")
    again = replace(large, target="again")

    def found(limit: int, *copies: FileCopy) -> list[Diagnostic]:
        every = {plan.slug: (small, replace(linked, shared="0", is_linked=True)), "other": copies}
        return artifact_problems(Compiled(Suite((plan, other)), every), JobOptions(artifact_mb=limit))

    (problem,) = found(100, large, again)
    assert (problem.severity, problem.rule, problem.span.file) == ("warning", "pipeline-limit", plan.spec)
    assert "has 121 MB of files before it is packed, more than 100 MB" in problem.message
    assert "again (60 MB), large (60 MB), small (1 MB)" in problem.message
    assert "--files repository" in problem.hint and "--artifact-limit" in problem.hint
    assert found(121, large, again) == found(0, large, again) == []
    assert found(100, *(replace(copy, shared="1") for copy in (large, again))) == []


@pytest.mark.thorough
def test_jobs_with_files_of_the_repository_check_it_out(
    plan: Plan, tmp_path: Path, accepted: Callable[..., None]
) -> None:
    file = render_pipeline(Suite((plan,)), "generated", JobOptions(from_repository=True))
    job = pipeline(file.text)[plan.slug]
    assert job["variables"] == {"GIT_STRATEGY": "fetch", "GIT_LFS_SKIP_SMUDGE": "0"}
    assert "variables" not in child(plan)[plan.slug]
    (tmp_path / file.path).write_text(file.text)
    accepted(tmp_path / file.path)


def test_artifacts_of_the_child_expire(plan: Plan) -> None:
    made = pipeline(render_pipeline(Suite((plan,)), "generated").text)
    kept = [job["artifacts"] for job in made.values() if "artifacts" in job]
    assert len(kept) == 1 and all(artifacts["expire_in"] for artifacts in kept)
