"""The templates that repositories include: GitLab's schema takes them, and their scripts do what they say."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl import package_data
from dodo_dsl.cli.main import main
from tests.emit.readers import pipeline
from tests.gitlab.inputs import TEMPLATES, Refused, included, jobs, listed, merged, specified
from tests.gitlab.rules import KINDS

APPLICATION, DEPLOYMENT, RUN = TEMPLATES
TRIGGERS = {"allow_failure", "extends", "inherit", "interruptible", "needs", "rules", "stage", "trigger", "variables"}
"""Keywords of a job that triggers a pipeline, of those that GitLab allows: no image, tags, script or artifacts."""
PAGE = Path(__file__).parents[2] / "docs/how-to/gitlab.md"
PAGES = [PAGE, *PAGE.parent.glob("gitlab-*.md")]
SHIPPED_TEST = str(package_data.registry() / "sil-closed-straight")
DIGEST = "sha256:" + "0123456789abcdef" * 4

NO_BUILD = {"group": {"default": {"targets": None}}, "target": {}}
BAKE = {
    "group": {"default": {"targets": ["steering", "lane-finder"]}},
    "target": {"lane-finder": {"context": "."}, "steering": {"context": "."}},
}

# What `docker buildx bake` prints and writes, as buildx 0.13 does it; what it is told stands in calls.txt.
DOCKER = f"""#!/bin/sh
calls=$(dirname "$0")/../calls.txt
echo "$@" >> "$calls"
env > "$calls.environment"
case "$*" in
login*) cat > "$calls.token" ;;
*--print*) echo '{json.dumps(BAKE, indent=2)}' ;;
*"buildx create"*) echo "$4" ;;
*--push*) while [ "$1" != --metadata-file ]; do shift; done
          echo '{json.dumps({"x": {"containerimage.digest": DIGEST}}, indent=2)}' > "$2" ;;
esac
"""


def named(path: Path) -> str:
    return path.parent.name


each = pytest.mark.parametrize("template", TEMPLATES, ids=named)
each_parent = pytest.mark.parametrize("template", [APPLICATION, DEPLOYMENT], ids=named)


def test_each_template_is_a_component() -> None:
    """GitLab finds `templates/<name>/template.yml`, and no other file below `templates/` by mistake."""
    folder = package_data.templates()
    assert sorted(folder.glob("*/template.yml")) == sorted(TEMPLATES)
    assert not list(folder.glob("*.yml"))


@pytest.mark.thorough
def test_gitlab_accepts_the_templates(tmp_path: Path, accepted: Callable[..., None]) -> None:
    """As they are, and as their jobs are with inputs, extended."""
    for template in TEMPLATES:
        header = next(yaml.safe_load_all(template.read_text()))
        (tmp_path / f"{named(template)}.header.yml").write_text(yaml.safe_dump(header))
        for case, given in {
            "default": {},
            "given": {"tags": [], "image": "dodo-runner:1.0", "stage": "verify"},
        }.items():
            config = included(template, **given)
            (tmp_path / f"{named(template)}.{case}.yml").write_text(yaml.safe_dump(config))
            text = yaml.safe_dump(jobs(config))
            (tmp_path / f"{named(template)}.{case}.jobs.yml").write_text(text)
    accepted(*tmp_path.iterdir())


@each
def test_inputs_reach_all_jobs(template: Path) -> None:
    for name, job in jobs(included(template)).items():
        inherited = {"default": False, "variables": []}
        assert (job["stage"], job["inherit"], job["allow_failure"], "image" in job) == (
            "test", inherited, name == "dodo-report", False
        )  # fmt: skip
        assert job.get("tags") == (None if "trigger" in job else [] if template == RUN else ["$DODO_TAG"]), name
    for name, job in jobs(included(template, tags=[], image="registry/dodo:1", stage="verify")).items():
        found = job["stage"], job.get("tags"), job.get("image")
        assert found == (("verify", None, None) if "trigger" in job else ("verify", [], "registry/dodo:1")), name
    given = {"services": ["docker:dind"], "before_script": "a\nb", "variables": ["DOCKER_HOST"], "allow_failure": True}
    for name, job in jobs(included(template, artifacts_access="none", **given)).items():
        assert job["inherit"] == {"default": False, "variables": ["DOCKER_HOST"]}, name
        assert job["allow_failure"] is True
        if "script" in job:
            found = job["services"], job["before_script"], job["artifacts"]["access"]
            commands = [] if name == "dodo-pipeline" else ["a\nb"]  # as it has no checkout
            assert found == (["docker:dind"], commands, "none"), name
            assert (job.get("variables", {}).get("GIT_STRATEGY") == "none") == (name == "dodo-pipeline"), name


def test_the_team_s_jobs_are_waited_for_and_their_files_are_there() -> None:
    found = jobs(included(APPLICATION, needs=["build", {"job": "make", "artifacts": False}]))
    assert found["dodo-images"]["needs"] == ["build", {"job": "make", "artifacts": False}]
    assert found["compile"]["needs"][1:] == found["dodo-images"]["needs"]
    assert found["compile"]["needs"][0] == {"job": "dodo-images", "optional": True}
    assert found["dodo-check"]["needs"] == [], "it needs no file, and says at once what is wrong"
    assert jobs(included(RUN, needs=["build"]))["dodo-run"]["needs"] == ["build"]


def test_one_job_is_included_twice_by_another_name() -> None:
    night = included(RUN, job_name="nightly tests", rules="schedules", tests="sil-*")
    found = jobs(included(RUN), night)
    assert found.keys() == {"dodo-run", "nightly tests"}
    assert (found["dodo-run"]["variables"]["DODO_TESTS"], "rules" in found["dodo-run"]) == ("", False)


@each_parent
@pytest.mark.thorough
def test_what_the_child_s_jobs_have_reaches_the_compiler(template: Path, tmp_path: Path) -> None:
    """As GitLab hands it on, where a list in a text is written as Ruby does."""
    services = ["redis", {"name": "docker:dind", "alias": "docker", "command": ["--tls=false"]}]
    config = included(
        template, services=services, before_script='pip install "x"\n. ./env $A\n', artifacts_access="developer",
        tags=["a b"], image="dodo:1", run_options="-v",
    )  # fmt: skip
    variables = jobs(config)["compile"]["variables"]
    (tmp_path / "docker-compose.yml").write_text("services: {a: {command: --cid=111, x-dodo-process: [./a]}}\n")
    (tmp_path / "a").touch()
    (tmp_path / "dodo.yml").write_text("dodo: 1\napplication: docker-compose.yml\n")
    given = {name: value["value"] if isinstance(value, dict) else value for name, value in variables.items()}
    options = "DODO_TEST_SERVICES", "DODO_TEST_BEFORE_SCRIPT"
    assert all(variables[name]["expand"] is False for name in options), "the child's jobs have these variables"
    result = run_script(jobs(config)["compile"], tmp_path, {**given, "DODO_COMPILE_OPTIONS": SHIPPED_TEST})
    assert result.returncode == 0, result.stderr + result.stdout
    child = pipeline((tmp_path / "generated/child.gitlab-ci.yml").read_text())
    (job,) = [job for job in child.values() if "script" in job]
    assert (job["services"], job["tags"], job["image"]) == (services, ["a b"], "dodo:1")
    assert job["artifacts"]["access"] == "developer"
    login = child["default"]["before_script"]
    assert job["before_script"] == ['pip install "x"\n. ./env $A', *login], "which may wait for the engine of the login"


@each
def test_jobs_that_trigger_have_what_gitlab_allows_them(template: Path) -> None:
    for job in jobs(included(template, image="registry/dodo:1")).values():
        assert "trigger" not in job or job.keys() <= TRIGGERS


def test_a_newer_commit_may_cancel_all() -> None:
    """One job that has begun and may not be cancelled keeps GitLab from cancelling the others."""
    for template in TEMPLATES:
        assert all(job["interruptible"] is True for job in jobs(included(template)).values())


@each
def test_every_input_is_described_used_and_optional(template: Path) -> None:
    _, text = template.read_text().split("\n---\n")
    for name, spec in specified(template).items():
        assert spec["description"] and "default" in spec
        assert f"$[[ inputs.{name} ]]" in text
        free = name in ("compose-file", "before-script")
        assert free or "regex" in spec or "options" in spec or spec["type"] in ("array", "boolean"), "narrow"


@each
def test_no_input_becomes_text_of_a_shell(template: Path) -> None:
    """They are variables there: a shell takes those as words, whatever they hold. One input is commands by its name."""
    for job in yaml.safe_load(template.read_text().split("\n---\n")[1]).values():
        assert "$[[" not in str([job.get(key) for key in ("script", "after_script")])
        assert job.get("before_script") in (None, [], ["$[[ inputs.before-script ]]"])


@each
def test_a_text_holds_one_input_at_most(template: Path) -> None:
    """GitLab 17.0 puts in only the first."""
    for text in re.findall(r"[\"'].*?[\"']|\S+", template.read_text()):
        assert text.count("$[[") <= 1, text


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("compile_options", "--check; rm -rf ."),
        ("run_options", "$(touch x)"),
        ("run_options", "`touch x`"),
        ("image", "dodo runner"),
        ("platforms", "linux/amd64 --push"),
        ("platforms", "linux/amd64,"),
        ("deployment", "group/car\n    branch: x"),
        ("tags", "sil"),
        ("stage", ""),
        ("rules", "merge_requests"),
        ("artifacts_access", "everyone"),
        ("allow_failure", "yes"),
    ],
)
def test_inputs_that_cannot_be_meant_are_refused(name: str, value: str) -> None:
    with pytest.raises(Refused):
        included(APPLICATION, **{name: value})


def test_inputs_that_can_be_meant_are_taken() -> None:
    config = included(
        APPLICATION,
        compile_options="--jobs 4 'sil-*'",
        platforms="linux/amd64,linux/arm/v7",
        image="$CI_REGISTRY_IMAGE/dodo@sha256:12",
        deployment="$CI_PROJECT_NAMESPACE/deployment",
        tags=["sil", "large machine"],
    )
    found = jobs(config)
    assert found["compile"]["variables"]["DODO_TEST_TAGS"] == ' ["sil", "large machine"]'
    assert found["dodo-images"]["variables"]["DODO_PLATFORMS"] == "linux/amd64,linux/arm/v7"


@pytest.mark.thorough
def test_gitlab_accepts_what_dodo_new_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Callable[..., None]
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in (["new", "--deployment"], ["new", "first"], ["compile"]):
        assert main(words, StringIO(), StringIO()) == 0
    accepted(tmp_path / ".gitlab-ci.yml", tmp_path / "generated/child.gitlab-ci.yml")
    included = yaml.safe_load((tmp_path / ".gitlab-ci.yml").read_text())["include"]
    assert all((tmp_path / entry["local"]).is_file() for entry in included)


@each_parent
def test_the_child_is_triggered_as_its_jobs_need_it(template: Path) -> None:
    """The child's jobs take their files from ``compile``; its YAML comes from an artifact that holds nothing else."""
    found = included(template)
    (trigger,) = [job for job in found.values() if "PARENT_PIPELINE_ID" in str(job) and "trigger" in job]
    assert trigger["variables"] == {"PARENT_PIPELINE_ID": "$CI_PIPELINE_ID"}
    assert trigger["trigger"]["strategy"] == "depend"
    (include,) = trigger["trigger"]["include"]
    assert found[include["job"]]["artifacts"]["paths"] == [include["artifact"]]
    assert found["compile"]["artifacts"]["paths"] == ["generated/"]


def test_jobs_of_both_templates_are_the_same() -> None:
    """A pipeline that includes both has each of them once, whatever the order: GitLab merges jobs of one name."""
    first, second = (yaml.safe_load(template.read_text().split("\n---\n")[1]) for template in (APPLICATION, DEPLOYMENT))
    common = {"dodo-check", "compile", "dodo-pipeline", "dodo-tests", "dodo-report"}
    shared = {name for name in first.keys() & second.keys() if not name.startswith(".")} - {"variables"}
    assert shared == common
    hidden = {name for name in first if name.startswith(".")}
    assert {name for name in second if name.startswith(".")} == hidden - {".dodo-images-true", ".dodo-images-false"}
    del first[".dodo-job"]["variables"]["DODO_COMPOSE_FILE"]
    assert all(first[name] == second[name] for name in first.keys() & second.keys())
    one = yaml.safe_load(RUN.read_text().split("\n---\n")[1])
    assert {name for name in one if name.startswith(".dodo-in-")} == {n for n in hidden if n.startswith(".dodo-in-")}
    assert all(one[name] == first[name] for name in one.keys() & first.keys()), "one set of rules"
    inputs = specified(APPLICATION), specified(DEPLOYMENT)
    assert inputs[1].keys() < inputs[0].keys()
    assert all(inputs[0][name] == spec for name, spec in inputs[1].items())


@pytest.mark.parametrize("language", ["python", "cpp"])
def test_the_first_push_of_a_new_application_runs_its_tests(
    language: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "--application", "--language", language], StringIO(), StringIO()) == 0
    entries = yaml.safe_load((tmp_path / ".gitlab-ci.yml").read_text())["include"]
    names = [Path(entry["local"]).name.partition(".")[0] for entry in entries]
    folder = package_data.templates()
    configs = [
        included(folder / name / "template.yml", **entry["inputs"]) for name, entry in zip(names, entries, strict=True)
    ]
    found = jobs(*configs).keys() - {"dodo-deployment"}
    assert found == {"dodo-check", "compile", "dodo-pipeline", "dodo-tests", "dodo-report"} | (
        {"dodo-images"} if language == "cpp" else set()
    )
    assert listed(merged(*configs), KINDS["push to a branch"]) == found


@each
def test_a_template_is_a_guest_in_the_repository_s_pipeline(template: Path) -> None:
    """No workflow, stages or defaults, which would change other jobs; and no job but ``compile`` of a common name."""
    found = included(template)
    assert found.pop("variables") == {}
    names = found.keys() - ({"compile"} if template != RUN else set())
    assert all(name.startswith(("dodo-", ".dodo")) for name in names), "no workflow, stages, default, variables, ..."


@each
def test_no_template_names_a_host_or_shows_the_token(template: Path) -> None:
    text = template.read_text()
    assert not re.findall(r"https?://|[a-z0-9-]+\.(?:com|org|io|net)\b", text)
    for line in text.splitlines():
        assert "CI_JOB_TOKEN" not in line or line.strip().startswith("- printf '%s' \"$CI_JOB_TOKEN\" | docker login")


@each_parent
@pytest.mark.thorough
def test_the_problems_are_in_the_log_and_in_a_file_that_can_be_browsed(template: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.dodo.yml").write_text("dodo: 1\nname: bad\n")
    job = included(template)["dodo-check"]
    result = run_script(job, tmp_path, {"DODO_COMPILE_OPTIONS": "bad.dodo.yml"})
    assert result.returncode == 2
    assert "bad.dodo.yml:1:1: error[missing-key]" in result.stderr
    (path,) = job["artifacts"]["paths"]
    assert path == job["artifacts"]["reports"]["codequality"]
    assert "missing-key" in {row["check_name"] for row in json.loads((tmp_path / path).read_text())}


@each_parent
def test_another_job_of_the_name_compile_is_told(template: Path, tmp_path: Path) -> None:
    job = included(template)["dodo-pipeline"]
    result = run_script(job, tmp_path, {})
    assert (result.returncode, result.stderr) == (1, "")
    told = "job 'compile' wrote no generated/child.gitlab-ci.yml; does another job have its name?\n"
    assert result.stdout == told
    (tmp_path / "generated/first").mkdir(parents=True)
    (tmp_path / "generated/child.gitlab-ci.yml").touch()
    result = run_script(job, tmp_path, {})
    assert result.returncode == 1
    assert "No test was found, so nothing was tested; to allow that, set the input 'no-tests: pass'" in result.stdout
    assert jobs(included(template))["dodo-pipeline"]["variables"]["DODO_NO_TESTS"] == "fail"
    assert jobs(included(template, no_tests="pass"))["dodo-pipeline"]["variables"]["DODO_NO_TESTS"] == "pass"
    result = run_script(job, tmp_path, {"DODO_NO_TESTS": "pass"})
    assert (result.returncode, "No test was found" in result.stdout) == (0, True)
    (tmp_path / "generated/first/test.json").touch()
    assert run_script(job, tmp_path, {}).returncode == 0


def run_script(job: dict[str, Any], folder: Path, variables: dict[str, str]) -> "subprocess.CompletedProcess[str]":
    """A job's script as a runner's shell runs it, with the ``dodo`` of these tests."""
    (folder / "bin").mkdir(exist_ok=True)
    program = f'#!/bin/sh\nexec {sys.executable} -m dodo_dsl "$@"\n'
    (folder / "bin/dodo").write_text(program)
    (folder / "bin/dodo").chmod(0o755)
    environment = {
        "PATH": f"{folder / 'bin'}:{os.environ['PATH']}",
        "PYTHONPATH": str(package_data.root()),
        **variables,
    }
    script = "set -e\n" + "\n".join(job["script"])
    return subprocess.run(
        ["sh", "-c", script], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


BUILT = "services: {lane-finder: {build: ., command: --cid=111}, steering: {build: {context: ., ssh: [default]}}}\n"


def run_images(tmp_path: Path, docker: str, compose: str = BUILT, **inputs: Any) -> "subprocess.CompletedProcess[str]":
    config = included(APPLICATION, **inputs)
    job = config["dodo-images"]
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin/docker").write_text(docker)
    (tmp_path / "bin/docker").chmod(0o755)
    (tmp_path / "app").mkdir()
    (tmp_path / "app/docker-compose.yml").write_text(compose)
    (tmp_path / "app/.git").mkdir()
    (tmp_path / "app/.git/config").write_text("url = https://gitlab-ci-token:secret@gitlab.example.org/team/car.git")
    (tmp_path / "bin/dodo").write_text(f'#!/bin/sh\nexec {sys.executable} -P -m dodo_dsl "$@"\n')
    (tmp_path / "bin/dodo").chmod(0o755)
    environment = {
        "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}",
        "HOME": str(tmp_path),
        "DOCKER_CONFIG": str(tmp_path / "private/docker"),
        "PYTHONPATH": str(package_data.root()),
        "CI_JOB_TOKEN": "secret",
        "CI_REGISTRY": "registry.example.org",
        "CI_REGISTRY_IMAGE": "registry.example.org/team/car",
        "CI_COMMIT_SHA": "c0ffee",
        "CI_JOB_ID": "7",
        "CI_PROJECT_DIR": str(tmp_path),
        "DODO_COMPOSE_FILE": "app/docker-compose.yml",
        "DODO_PLATFORMS": jobs(config)["dodo-images"]["variables"]["DODO_PLATFORMS"],
        "DODO_DEPLOYMENT": "team/deployment",
        "DODO_DEPLOYMENT_BRANCH": "main",
    }
    script = "set -e\n" + "\n".join(job["script"])
    result = subprocess.run(
        ["sh", "-c", script], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    subprocess.run(["sh", "-ec", "\n".join(job["after_script"])], cwd=tmp_path, env=environment, check=True)
    return result


@pytest.mark.thorough
def test_the_user_s_own_plugins_are_found_beside_the_job_s_login(tmp_path: Path) -> None:
    """Docker looks for Compose and buildx below DOCKER_CONFIG, which the job sets."""
    plugin = tmp_path / ".docker/cli-plugins/docker-buildx"
    plugin.parent.mkdir(parents=True)
    plugin.touch()
    result = run_images(tmp_path, DOCKER)
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "private/docker/cli-plugins/docker-buildx").samefile(plugin)


@pytest.mark.thorough
def test_images_are_pushed_and_handed_on_by_digest(tmp_path: Path, accepted: Callable[..., None]) -> None:
    result = run_images(tmp_path, DOCKER)
    assert result.returncode == 0, result.stderr
    calls = (tmp_path / "calls.txt").read_text()
    assert "secret" not in calls + result.stdout
    assert (tmp_path / "calls.txt.token").read_text() == "secret"
    checked = tmp_path / "private/docker/builds.yml"
    assert f"buildx bake --file {checked} --set lane-finder.tags=" in calls
    context = Path(json.loads(checked.read_text())["services"]["steering"]["build"].pop("context"))
    assert context.is_relative_to(checked.parent / "contexts")
    assert [path.name for path in context.iterdir()] == ["docker-compose.yml"]
    assert "secret" not in (tmp_path / "calls.txt.environment").read_text()
    image = "registry.example.org/team/car"
    images = {
        "DODO_IMAGE_LANE_FINDER": f"{image}/lane-finder@{DIGEST}",
        "DODO_IMAGE_STEERING": f"{image}/steering@{DIGEST}",
    }
    lines = (tmp_path / "dodo-images.env").read_text().splitlines()
    assert dict(line.split("=", 1) for line in lines) == images
    downstream = tmp_path / "dodo-deployment.gitlab-ci.yml"
    job: dict[str, Any] = yaml.safe_load(downstream.read_text())["deployment"]
    assert job["variables"] == images
    assert job["trigger"] == {"project": "team/deployment", "branch": "main", "strategy": "depend"}
    accepted(downstream)


@pytest.mark.parametrize("build", ["/", "{context: ., network: host}", "{context: ., dockerfile: ../../x}"])
@pytest.mark.thorough
def test_nothing_is_built_that_is_not_checked(tmp_path: Path, build: str) -> None:
    result = run_images(tmp_path, DOCKER, f"services: {{a: {{build: {build}, command: --cid=111}}}}\n")
    assert result.returncode == 1
    assert "error[application-isolation]" in result.stderr
    assert "bake" not in (tmp_path / "calls.txt").read_text()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("*--print*) ", "*--print*) echo no such file; exit 1 ;; *--other*) "), ""),
        (("containerimage.digest", "image.name"), "The build of lane-finder has said no digest"),
    ],
)
@pytest.mark.thorough
def test_a_build_without_images_fails(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    result = run_images(tmp_path, DOCKER.replace(*change))
    assert (result.returncode, "".join(result.stdout.splitlines()[-1:])) == (1, said)


@pytest.mark.thorough
def test_images_are_built_for_the_platforms_that_are_asked_for(tmp_path: Path) -> None:
    assert run_images(tmp_path, DOCKER, platforms="linux/amd64,linux/arm64").returncode == 0
    calls = (tmp_path / "calls.txt").read_text()
    assert " --push --set lane-finder.platform=linux/amd64,linux/arm64 --metadata-file " in calls
    _, context, builder, *bakes, gone = calls.splitlines()  # the first one logs in
    assert context == "context create dodo-7"
    assert builder == "buildx create --name dodo-7 --driver docker-container dodo-7"
    assert {call.partition(" bake ")[0] for call in bakes} == {"buildx --builder dodo-7"}
    assert gone == "buildx rm --force dodo-7"


@pytest.mark.thorough
def test_without_platforms_the_engine_builds_by_itself(tmp_path: Path) -> None:
    assert run_images(tmp_path, DOCKER).returncode == 0
    assert "dodo-7" not in (tmp_path / "calls.txt").read_text()


@pytest.mark.thorough
def test_an_application_without_a_build_has_no_images(tmp_path: Path, accepted: Callable[..., None]) -> None:
    """It runs as processes, or its images come from elsewhere; the deployment is triggered all the same."""
    result = run_images(tmp_path, DOCKER.replace(json.dumps(BAKE, indent=2), json.dumps(NO_BUILD, indent=2)))
    assert result.returncode == 0, result.stderr
    assert "No service of app/docker-compose.yml has a build" in result.stdout
    assert (tmp_path / "dodo-images.env").read_text() == ""
    downstream = tmp_path / "dodo-deployment.gitlab-ci.yml"
    assert "variables" not in yaml.safe_load(downstream.read_text())["deployment"]
    accepted(downstream)


def test_the_page_s_variables_are_those_of_the_templates() -> None:
    page = "".join(page.read_text() for page in PAGES)
    templates = "".join(template.read_text() for template in TEMPLATES)
    for variable in set(re.findall(r"DODO_[A-Z_]+[A-Z]", page)) - {
        "DODO_IMAGE",
        "DODO_IMAGE_LANE_FINDER",
        "DODO_API_TOKEN",
        "DODO_SEARCH_STORAGE",
        "DODO_RUN_OPTIONS",
        "DODO_REGISTRY",
    }:
        assert f"  {variable}:" in templates, variable


def test_the_page_s_inputs_are_those_of_the_templates() -> None:
    blocks = [
        yaml.safe_load(b) for b in re.findall(r"```yaml\n(.*?)```", "".join(map(Path.read_text, PAGES)), re.DOTALL)
    ]
    includes = [entry for block in blocks for entry in block.get("include", [])]
    assert len(includes) >= len(TEMPLATES)
    assert "`compile`" in PAGE.read_text().partition("## A deployment repository")[0], (
        "the one name that others may have"
    )
    for entry in includes:
        assert entry["inputs"]["stage"] == "test", "who has stages of their own has to see where one goes"
        name = re.search(r"(\w+)(\.gitlab-ci\.yml|@[\d.]+)$", entry.get("local", entry.get("component")))
        included(package_data.templates() / name[1] / "template.yml", **entry.get("inputs", {}))  # type: ignore[index]
    rows = re.findall(
        r"^\| `([\w-]+)` \| .*? \| (all|(?:`\w+`, )?`(?:application|run)`) \| ", PAGE.read_text(), re.MULTILINE
    )
    columns = {
        "all": TEMPLATES,
        "`deployment`, `application`": [APPLICATION, DEPLOYMENT],
        "`application`": [APPLICATION],
    }
    columns |= {"`run`": [RUN], "`application`, `run`": [APPLICATION, RUN]}
    for template in TEMPLATES:
        assert {name for name, of in rows if template in columns[of]} == specified(template).keys()
