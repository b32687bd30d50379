"""DoDo's own pipeline: GitLab takes it, and it runs what CONTRIBUTING tells people to run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from dodo_dsl import __version__
from tests.contributing import components_page
from tests.gitlab.inputs import included

ROOT = Path(__file__).parents[2]
FILE = ROOT / ".gitlab-ci.yml"
PIPELINE = yaml.safe_load(FILE.read_text())
JOBS = {name: f"make {name}" for name in ("check", "test", "proof")}


@pytest.mark.thorough
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


def test_the_smoke_test_is_the_component_of_this_commit() -> None:
    """With inputs that its template takes, in a stage that there is; it runs a test that ships."""
    (include,) = PIPELINE["include"]
    assert include["component"] == "$CI_SERVER_FQDN/$CI_PROJECT_PATH/run@$CI_COMMIT_SHA"
    given = {name.replace("-", "_"): value for name, value in include["inputs"].items()}
    job = included(components_page.template("run"), **given)["smoke"]
    assert job["stage"] in PIPELINE["stages"] and job["inherit"]["variables"] == ["DODO_CI_IMAGE"]
    assert (ROOT / "tests_registry" / job["variables"]["DODO_TESTS"]).is_dir()


TAGS = [
    ("0.2.0", True),
    ("1.0.0-rc.1", True),
    ("v0.2.0", False),
    ("0.2", False),
    ("0.2.0x", False),
    ("notes-0.2.0", False),
]


@pytest.mark.parametrize(("tag", "released"), TAGS)
def test_semantic_tags_are_released(tag: str, released: bool) -> None:
    """GitLab's catalog takes no others."""
    (rule,) = PIPELINE["release"]["rules"]
    expression = re.fullmatch(r"\$CI_COMMIT_TAG =~ /(.*)/", rule["if"])
    assert expression and bool(re.search(expression[1], tag)) == released
    assert PIPELINE["release"]["release"]["tag_name"] == "$CI_COMMIT_TAG"
    assert PIPELINE["stages"][-1] == PIPELINE["release"]["stage"], "only what was tested"
    assert PIPELINE["release"]["inherit"] == {"default": False}


@pytest.mark.parametrize(
    ("tag", "changes", "code"),
    [
        (
            __version__,
            f"# Changelog\n\n## [Unreleased]\n\n## [{__version__}] - 2026-11-25\n\n- New.\n\n## [0.0.1]\n\n- Old.\n",
            0,
        ),
        (__version__, "# Changelog\n\n## [Unreleased]\n\n- New.\n", 1),
        ("99.0.0", "## [99.0.0]\n\n- New.\n", 1),
    ],
    ids=["released", "no changes", "another version"],
)
def test_a_release_tells_the_changes_of_its_version(tmp_path: Path, tag: str, changes: str, code: int) -> None:
    job = PIPELINE["release"]
    (tmp_path / "dodo_dsl").mkdir()
    (tmp_path / "dodo_dsl/__init__.py").write_text((ROOT / "dodo_dsl/__init__.py").read_text())
    (tmp_path / "CHANGELOG.md").write_text(changes)
    environment = {"PATH": "/usr/bin:/bin", "CI_COMMIT_TAG": tag}
    script = ["sh", "-ec", "\n".join(job["script"])]
    done = subprocess.run(script, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stdout + done.stderr
    if not code:
        assert (tmp_path / job["release"]["description"]).read_text().strip() == "- New."


@pytest.mark.parametrize("name", components_page.ABOUT)
def test_components_tell_their_version_to_jobs(name: str) -> None:
    """As the tag of an image, which GitLab before 18.6, a branch and a commit cannot tell them."""
    _, config = yaml.safe_load_all(components_page.template(name).read_text())
    jobs = [job for job in config.values() if "DODO_VERSION" in job.get("variables", {})]
    assert [job["variables"]["DODO_VERSION"] for job in jobs] == [__version__]


def test_the_page_of_components_is_up_to_date() -> None:
    """With a section for each, to which the page that the catalog shows leads."""
    assert components_page.PAGE.read_text() == components_page.text(), "run scripts/make-components"
    assert {path.parent.name for path in (ROOT / "templates").glob("*/template.yml")} == set(components_page.ABOUT)
    readme = (ROOT / "README.md").read_text()
    assert all(f"docs/reference/components.md#{name})" in readme for name in components_page.ABOUT)
