"""DoDo's own pipeline: GitLab takes it, and its smoke test is a component."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.contributing import components_page
from tests.gitlab.inputs import included

ROOT = Path(__file__).parents[2]
FILE = ROOT / ".gitlab-ci.yml"
PIPELINE = yaml.safe_load(FILE.read_text())


@pytest.mark.thorough
def test_gitlab_accepts_it() -> None:
    program = Path(sys.executable).parent / "check-jsonschema"
    options = ("--builtin-schema", "vendor.gitlab-ci", "--data-transform", "gitlab-ci")
    result = subprocess.run([program, *options, FILE], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_smoke_test_is_the_component_of_this_commit() -> None:
    """With inputs that its template takes, in a stage that there is; it runs a test that ships."""
    (include,) = PIPELINE["include"]
    assert include["component"] == "$CI_SERVER_FQDN/$CI_PROJECT_PATH/run@$CI_COMMIT_SHA"
    given = {name.replace("-", "_"): value for name, value in include["inputs"].items()}
    job = included(components_page.template("run"), **given)["smoke"]
    assert job["stage"] in PIPELINE["stages"] and job["inherit"]["variables"] == ["DODO_CI_IMAGE"]
    assert (ROOT / "tests_registry" / job["variables"]["DODO_TESTS"]).is_dir()


def test_the_page_of_components_is_up_to_date() -> None:
    """With a section for each, to which the page that the catalog shows leads."""
    assert components_page.PAGE.read_text() == components_page.text(), "run scripts/make-components"
    assert {path.parent.name for path in (ROOT / "templates").glob("*/template.yml")} == set(components_page.ABOUT)
    readme = (ROOT / "README.md").read_text()
    assert all(f"docs/reference/components.md#{name})" in readme for name in components_page.ABOUT)
