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
from tests.gitlab.inputs import TEMPLATES, Refused, included, jobs, merged, specified

TESTS, RUN = TEMPLATES
TRIGGERS = {"allow_failure", "extends", "inherit", "interruptible", "needs", "rules", "stage", "trigger", "variables"}
"""Keywords of a job that triggers a pipeline, of those that GitLab allows: no image, tags, script or artifacts."""
PAGE = Path(__file__).parents[2] / "docs/how-to/gitlab.md"
SHIPPED_TEST = str(package_data.registry() / "sil-closed-straight")
DIGEST = "sha256:" + "0123456789abcdef" * 4
IMAGE = "registry.example.org/team/car"

# What `docker buildx bake` writes; what it is told stands in calls.txt.
DOCKER = f"""#!/bin/sh
calls=$(dirname "$0")/../calls.txt
echo "$@" >> "$calls"
case "$*" in
login*) cat > "$calls.token" ;;
*"buildx create"*) echo "$4" ;;
*--push*) env > "$calls.environment"; cp "$4" "$calls.builds"; ls "$DOCKER_CONFIG/cli-plugins" > "$calls.plugins"
          while [ "$1" != --metadata-file ]; do shift; done
          echo '{
    json.dumps(
        {
            name: {"image.name": f"{IMAGE}/{name}:c0ffee", "containerimage.digest": DIGEST}
            for name in ("lane-finder", "steering")
        }
    )
}' > "$2" ;;
esac
"""


def named(path: Path) -> str:
    return path.parent.name


each = pytest.mark.parametrize("template", TEMPLATES, ids=named)


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
        for case, given in {"default": {}, "given": {"tags": [], "image": "runner:1.0", "stage": "verify"}}.items():
            config = included(template, **given)
            (tmp_path / f"{named(template)}.{case}.yml").write_text(yaml.safe_dump(config))
            (tmp_path / f"{named(template)}.{case}.jobs.yml").write_text(yaml.safe_dump(jobs(config)))
    accepted(*tmp_path.iterdir())


@each
def test_inputs_reach_all_jobs(template: Path) -> None:
    given = {"services": ["docker:dind"], "before_script": "a\nb", "variables": ["DOCKER_HOST"], "tags": []}
    for name, job in jobs(included(template, image="registry/dodo:1", stage="verify", **given)).items():
        assert job["inherit"] == {"default": False, "variables": ["DOCKER_HOST"]}
        assert (job["stage"], job["interruptible"], "rules" in job) == ("verify", True, name == "dodo-downstream")
        if "trigger" in job:
            assert job.keys() <= TRIGGERS
        else:
            assert (job["tags"], job["image"], job["services"]) == ([], "registry/dodo:1", ["docker:dind"])
            assert job["before_script"] == ([] if name == "dodo-pipeline" else ["a\nb"]), "it has no checkout"


def test_keywords_of_the_team_s_own_reach_all_jobs() -> None:
    own = {".dodo": {"rules": [{"if": "$NIGHT"}], "allow_failure": True}}
    for name, job in jobs(included(TESTS), own).items():
        assert job["allow_failure"] is True
        assert (job["rules"] == [{"if": "$NIGHT"}]) is (name != "dodo-downstream")
    night = merged(included(RUN, job_name="night"), {"night": {"parallel": 4}})
    assert jobs(included(RUN), night)["night"]["parallel"] == 4 and "dodo-run" in jobs(included(RUN), night)


def test_the_team_s_jobs_are_waited_for() -> None:
    needs = ["build", {"job": "make", "artifacts": False}]
    assert jobs(included(TESTS, needs=needs))["dodo-compile"]["needs"] == needs
    assert jobs(included(RUN, needs=needs))["dodo-run"]["needs"] == needs


@each
def test_every_input_is_described_used_and_optional(template: Path) -> None:
    _, text = template.read_text().split("\n---\n")
    for name, spec in specified(template).items():
        assert spec["description"] and "default" in spec
        assert f"$[[ inputs.{name} ]]" in text
        free = name in ("compose-file", "before-script")
        assert free or "regex" in spec or spec["type"] in ("array", "boolean"), "narrow"


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
        ("image", ""),
        ("platforms", "linux/amd64 --push"),
        ("platforms", "linux/amd64,"),
        ("downstream", "group/car\n    branch: x"),
        ("tags", "sil"),
        ("stage", ""),
        ("images", "yes"),
    ],
)
def test_inputs_that_cannot_be_meant_are_refused(name: str, value: str) -> None:
    with pytest.raises(Refused):
        included(TESTS, **{name: value})


@pytest.mark.thorough
def test_gitlab_accepts_what_dodo_new_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Callable[..., None]
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in (["new", "--deployment"], ["new", "first"], ["compile"]):
        assert main(words, StringIO(), StringIO()) == 0
    accepted(tmp_path / ".gitlab-ci.yml", tmp_path / "generated/child.gitlab-ci.yml")
    (entry,) = yaml.safe_load((tmp_path / ".gitlab-ci.yml").read_text())["include"]
    assert (tmp_path / entry["local"]).read_bytes() == TESTS.read_bytes()
    included(TESTS, **entry["inputs"])


def test_the_child_is_triggered_as_its_jobs_need_it() -> None:
    """The child's jobs take their files from ``dodo-compile``; GitLab reads its YAML from an artifact without them."""
    found = included(TESTS)
    trigger = found["dodo-tests"]
    assert trigger["variables"]["DODO_PARENT_PIPELINE_ID"] == "$CI_PIPELINE_ID"
    assert trigger["trigger"]["strategy"] == "depend"
    (include,) = trigger["trigger"]["include"]
    assert include == {"artifact": "generated/child.gitlab-ci.yml", "job": "dodo-pipeline"}
    assert found["dodo-pipeline"]["artifacts"]["paths"] == ["generated/*.gitlab-ci.yml"]
    assert "generated/" in found["dodo-compile"]["artifacts"]["paths"]


@each
def test_a_template_is_a_guest_in_the_repository_s_pipeline(template: Path) -> None:
    """No workflow, stages, defaults or variables, which would change other jobs, and no job of a common name."""
    assert all(name.startswith(("dodo-", ".dodo")) for name in included(template))


@each
def test_no_template_names_a_host_or_shows_the_token(template: Path) -> None:
    text = template.read_text()
    assert not re.findall(r"https?://|[a-z0-9-]+\.(?:com|org|io|net)\b", text)
    for line in text.splitlines():
        assert "CI_JOB_TOKEN" not in line or line.strip().startswith("printf '%s' \"$CI_JOB_TOKEN\" | docker login")


def compiled(folder: Path, variables: dict[str, str], **inputs: Any) -> "subprocess.CompletedProcess[str]":
    """The job ``dodo-compile`` as a runner's shell runs it, with the ``dodo`` of these tests and a false docker."""
    job = jobs(included(TESTS, **inputs))["dodo-compile"]
    (folder / "bin").mkdir(exist_ok=True)
    for name, program in (("dodo", f'#!/bin/sh\nexec {sys.executable} -P -m dodo_dsl "$@"\n'), ("docker", DOCKER)):
        (folder / "bin" / name).write_text(program)
        (folder / "bin" / name).chmod(0o755)
    own = {name: value["value"] if isinstance(value, dict) else value for name, value in job["variables"].items()}
    environment = {
        **own,
        "PATH": f"{folder / 'bin'}:{os.environ['PATH']}",
        "HOME": str(folder),
        "PYTHONPATH": str(package_data.root()),
        "CI_JOB_TOKEN": "secret",
        "CI_REGISTRY": "registry.example.org",
        "CI_REGISTRY_IMAGE": IMAGE,
        "CI_COMMIT_SHA": "c0ffee",
        "CI_JOB_ID": "7",
        "CI_PROJECT_DIR": str(folder / "project"),
        **variables,
    }
    script = "set -e\n" + "\n".join(job["script"])
    result = subprocess.run(
        ["sh", "-c", script], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    subprocess.run(["sh", "-ec", "\n".join(job["after_script"])], cwd=folder, env=environment, check=True)
    return result


@pytest.mark.thorough
def test_what_the_child_s_jobs_have_reaches_the_compiler(tmp_path: Path) -> None:
    (tmp_path / "docker-compose.yml").write_text("services: {a: {command: --cid=111, x-dodo-process: [./a]}}\n")
    (tmp_path / "a").touch(0o755)
    (tmp_path / "dodo.yml").write_text("dodo: 1\napplication: docker-compose.yml\n")
    given = {
        "services": ["redis"],
        "before_script": 'pip install "x"\n. ./env $A\n',
        "tags": ["a b"],
        "image": "dodo:1",
    }
    result = compiled(tmp_path, {"DODO_COMPILE_OPTIONS": SHIPPED_TEST}, run_options="-v", **given)
    assert result.returncode == 0, result.stderr + result.stdout
    assert json.loads((tmp_path / "gl-code-quality-report.json").read_text()) == []
    child = pipeline((tmp_path / "generated/child.gitlab-ci.yml").read_text())
    job = child["sil-closed-straight"]
    assert (job["services"], job["tags"], job["image"]) == (["redis"], ["a b"], "dodo:1")
    assert job["before_script"] == ['pip install "x"\n. ./env $A']
    assert child["variables"] == {"DODO_RUN_OPTIONS": "-v"}
    assert not (tmp_path / "calls.txt").exists(), "nothing is built"


@pytest.mark.thorough
def test_problems_are_in_the_log_and_in_the_report(tmp_path: Path) -> None:
    (tmp_path / "bad.dodo.yml").write_text("dodo: 1\nname: bad\n")
    result = compiled(tmp_path, {"DODO_COMPILE_OPTIONS": "bad.dodo.yml"}, images=True)
    assert result.returncode == 2
    assert "bad.dodo.yml:1:1: error[missing-key]" in result.stderr
    report = jobs(included(TESTS))["dodo-compile"]["artifacts"]["reports"]["codequality"]
    assert "missing-key" in {row["check_name"] for row in json.loads((tmp_path / report).read_text())}
    assert not (tmp_path / "calls.txt").exists(), "nothing is built"


BUILT = "services: {lane-finder: {build: ., command: --cid=111}, steering: {build: {context: ., ssh: [default]}}}\n"


@pytest.fixture
def application(tmp_path: Path) -> Path:
    """A repository whose application is built, and without a test of its own."""
    (tmp_path / "app/.git").mkdir(parents=True)
    (tmp_path / "app/docker-compose.yml").write_text(BUILT)
    (tmp_path / "app/.git/config").write_text("url = https://gitlab-ci-token:secret@gitlab.example.org/team/car.git")
    (tmp_path / "tests").mkdir()
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: app/docker-compose.yml\n")
    return tmp_path


@pytest.mark.thorough
def test_images_are_pushed_and_handed_on_by_digest(application: Path, accepted: Callable[..., None]) -> None:
    plugin = application / ".docker/cli-plugins/docker-buildx"
    plugin.parent.mkdir(parents=True)
    plugin.touch()
    result = compiled(application, {}, images=True, downstream="team/vehicle", platforms="linux/amd64,linux/arm64")
    assert result.returncode == 0, result.stderr
    login, context, create, *_, bake, gone = (application / "calls.txt").read_text().splitlines()
    assert login.startswith("login") and (application / "calls.txt.token").read_text() == "secret"
    assert context == "context create dodo-7" and create == "buildx create --name dodo-7 dodo-7"
    assert bake.startswith("buildx bake --file ") and bake.endswith(" --set *.platform=linux/amd64,linux/arm64")
    assert gone == "buildx rm --force dodo-7"
    builds = json.loads((application / "calls.txt.builds").read_text())["services"]
    assert builds["steering"]["image"] == f"{IMAGE}/steering:c0ffee"
    assert "secret" not in (application / "calls.txt").read_text() + result.stdout
    environment = (application / "calls.txt.environment").read_text()
    assert "BUILDX_BUILDER=dodo-7\n" in environment and "secret" not in environment, "no build gets the job's own"
    assert (application / "calls.txt.plugins").read_text() == "docker-buildx\n", "those of the user"
    assert plugin.exists() and not (application / "project.tmp/docker").exists()
    images = {f"DODO_IMAGE_{n.replace('-', '_').upper()}": f"{IMAGE}/{n}@{DIGEST}" for n in ("lane-finder", "steering")}
    assert dict(line.split("=", 1) for line in (application / "dodo-images.env").read_text().splitlines()) == images
    downstream = application / "generated/downstream.gitlab-ci.yml"
    job = yaml.safe_load(downstream.read_text())["dodo-trigger"]
    assert job["variables"] == images
    assert job["trigger"] == {"project": "team/vehicle", "branch": "main", "strategy": "depend"}
    accepted(downstream, application / "generated/child.gitlab-ci.yml")


@pytest.mark.parametrize("build", ["/", "{context: ., network: host}", "{context: ., dockerfile: ../../x}"])
@pytest.mark.thorough
def test_nothing_is_built_that_is_not_checked(application: Path, build: str) -> None:
    (application / "app/docker-compose.yml").write_text(f"services: {{a: {{build: {build}, command: --cid=111}}}}\n")
    result = compiled(application, {}, images=True)
    assert result.returncode == 2
    assert "error[application-isolation]" in result.stderr
    assert not (application / "calls.txt").exists()


@pytest.mark.thorough
def test_an_application_without_a_build_has_no_images(application: Path) -> None:
    (application / "app/docker-compose.yml").write_text("services: {a: {image: a, command: --cid=111}}\n")
    result = compiled(application, {}, images=True, downstream="team/vehicle")
    assert result.returncode == 0, result.stderr
    downstream = yaml.safe_load((application / "generated/downstream.gitlab-ci.yml").read_text())
    assert "variables" not in downstream["dodo-trigger"]


def test_the_page_s_variables_and_inputs_are_those_of_the_templates() -> None:
    page, templates = PAGE.read_text(), "".join(template.read_text() for template in TEMPLATES)
    others = {"DODO_API_TOKEN", "DODO_SEARCH_STORAGE"}
    for variable in set(re.findall(r"DODO_(?!IMAGE)[A-Z_]+[A-Z]", page)) - others:
        assert f"  {variable}:" in templates, variable
    blocks = [yaml.safe_load(block) for block in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)]
    includes = [entry for block in blocks for entry in block.get("include", [])]
    assert len(includes) >= len(TEMPLATES)
    for entry in includes:
        assert entry["inputs"]["stage"] == "test", "who has stages of their own has to see where one goes"
        name = re.search(r"(\w+)(\.gitlab-ci\.yml|@[\d.]+)$", entry.get("local", entry.get("component")))
        given = {key.replace("-", "_"): value for key, value in entry["inputs"].items()}
        included(package_data.templates() / name[1] / "template.yml", **given)  # type: ignore[index]
