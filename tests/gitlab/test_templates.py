"""The templates that repositories include: GitLab's schema takes them, and their scripts do what they say."""

import json
import os
import re
import subprocess
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl import package_data
from dodo_dsl.cli.main import main

TEMPLATES = sorted((package_data.templates() / "gitlab").glob("*.yml"))
DIGEST = "sha256:" + "0123456789abcdef" * 4

BAKE = {
    "group": {"default": {"targets": ["steering", "lane-finder"]}},
    "target": {"lane-finder": {"context": "."}, "steering": {"context": "."}},
}

# What `docker buildx bake` prints and writes, as buildx 0.13 does it; what it is told stands in calls.txt.
DOCKER = f"""#!/bin/sh
echo "$PWD: $@" >> "$CALLS"
case "$*" in
login*) cat > "$CALLS.token" ;;
*--print*) echo '{json.dumps(BAKE, indent=2)}' ;;
*--push*) while [ "$1" != --metadata-file ]; do shift; done
          echo '{json.dumps({"x": {"containerimage.digest": DIGEST}}, indent=2)}' > "$2" ;;
esac
"""


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda p: p.name)
def test_gitlab_accepts_the_template(template: Path, accepted: Callable[..., None]) -> None:
    accepted(template)


def test_gitlab_accepts_what_dodo_new_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Callable[..., None]
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in (["new", "--deployment"], ["new", "first"], ["compile"]):
        assert main(words, StringIO(), StringIO()) == 0
    pipelines = (".gitlab-ci.yml", ".gitlab/dodo/deployment.gitlab-ci.yml", "generated/child.gitlab-ci.yml")
    accepted(*(tmp_path / name for name in pipelines))
    included = yaml.safe_load((tmp_path / ".gitlab-ci.yml").read_text())["include"]
    assert all((tmp_path / entry["local"]).is_file() for entry in included)


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda p: p.name)
def test_the_child_is_triggered_as_its_jobs_need_it(template: Path) -> None:
    """The child's jobs take their files from ``compile``; its YAML comes from an artifact that holds nothing else."""
    jobs = yaml.safe_load(template.read_text())
    (trigger,) = [job for job in jobs.values() if "PARENT_PIPELINE_ID" in str(job) and "trigger" in job]
    assert trigger["variables"] == {"PARENT_PIPELINE_ID": "$CI_PIPELINE_ID"}
    assert trigger["trigger"]["strategy"] == "depend"
    (include,) = trigger["trigger"]["include"]
    assert jobs[include["job"]]["artifacts"]["paths"] == [include["artifact"]]
    assert jobs["compile"]["artifacts"]["paths"] == ["generated/"]


def test_jobs_of_both_templates_are_the_same() -> None:
    """A pipeline that includes both has each of them once, whatever the order: GitLab merges jobs of one name."""
    first, second = (yaml.safe_load(template.read_text()) for template in TEMPLATES)
    shared = first.keys() & second.keys() - {"variables"}
    assert shared == {".dodo", ".dodo-rules", "dodo-check", "compile", "dodo-pipeline", "dodo-tests", "dodo-report"}
    assert {name: first[name] for name in shared} == {name: second[name] for name in shared}
    variables = (template["variables"] for template in (first, second))
    assert all(
        a == b for a, b in zip(*(map(v.get, ("DODO_TAG", "DODO_COMPILE_OPTIONS")) for v in variables), strict=True)
    )


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda p: p.name)
def test_a_template_is_a_guest_in_the_repository_s_pipeline(template: Path) -> None:
    """No workflow, stages or defaults, which would change other jobs; and no job but ``compile`` of a common name."""
    found = yaml.safe_load(template.read_text())
    assert not found.keys() & {"workflow", "stages", "default", "image", "before_script", "after_script", "cache"}
    names = found.keys() - {"variables", "compile"}
    assert all(name.startswith(("dodo-", ".dodo")) for name in names)
    assert all(name.startswith("DODO_") for name in found["variables"])


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda p: p.name)
def test_no_template_names_a_host_or_shows_the_token(template: Path) -> None:
    text = template.read_text()
    assert not re.findall(r"https?://|[a-z0-9-]+\.(?:com|org|io|net)\b", text)
    for line in text.splitlines():
        assert "CI_JOB_TOKEN" not in line or line.strip().startswith("- printf '%s' \"$CI_JOB_TOKEN\" | docker login")


def run_images(tmp_path: Path, docker: str) -> "subprocess.CompletedProcess[str]":
    job = yaml.safe_load((package_data.templates() / "gitlab/application.gitlab-ci.yml").read_text())["dodo-images"]
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin/docker").write_text(docker)
    (tmp_path / "bin/docker").chmod(0o755)
    (tmp_path / "app").mkdir()
    environment = {
        "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}",
        "CALLS": str(tmp_path / "calls.txt"),
        "CI_JOB_TOKEN": "secret",
        "CI_REGISTRY": "registry.example.org",
        "CI_REGISTRY_IMAGE": "registry.example.org/team/car",
        "CI_COMMIT_SHA": "c0ffee",
        "DODO_COMPOSE_FILE": "app/docker-compose.yml",
        "DODO_DEPLOYMENT": "team/deployment",
        "DODO_DEPLOYMENT_BRANCH": "main",
    }
    script = "set -e\n" + "\n".join(job["script"])
    return subprocess.run(
        ["sh", "-c", script], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )


def test_images_are_pushed_and_handed_on_by_digest(tmp_path: Path, accepted: Callable[..., None]) -> None:
    result = run_images(tmp_path, DOCKER)
    assert result.returncode == 0, result.stderr
    calls = (tmp_path / "calls.txt").read_text()
    assert "secret" not in calls + result.stdout
    assert (tmp_path / "calls.txt.token").read_text() == "secret"
    assert f"{tmp_path}/app: buildx bake --file docker-compose.yml --set lane-finder.tags=" in calls
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


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("*--print*) ", "*--print*) exit 0 ;; *--other*) "), "No service of app/docker-compose.yml has a build"),
        (("containerimage.digest", "image.name"), "The build of lane-finder has said no digest"),
    ],
)
def test_a_build_without_images_fails(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    result = run_images(tmp_path, DOCKER.replace(*change))
    assert (result.returncode, result.stdout.splitlines()[-1]) == (1, said)


def test_the_page_s_variables_are_those_of_the_templates() -> None:
    page = (Path(__file__).parents[2] / "docs/how-to/gitlab.md").read_text()
    templates = "".join(template.read_text() for template in TEMPLATES)
    for variable in set(re.findall(r"DODO_[A-Z_]+[A-Z]", page)) - {
        "DODO_IMAGE",
        "DODO_IMAGE_LANE_FINDER",
        "DODO_API_TOKEN",
        "DODO_SEARCH_STORAGE",
        "DODO_SEARCH_OPTIONS",
    }:
        assert f"  {variable}:" in templates, variable
    (block,) = [b for b in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL) if "include:" in b]
    (included,) = yaml.safe_load(block)["include"]
    assert Path(included["local"]).name in {template.name for template in TEMPLATES}
