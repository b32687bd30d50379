"""What ``dodo compile --check`` says of DoDo's templates in a repository's own pipeline."""

from pathlib import Path

import pytest
from dodo_dsl.cli.pipeline_file import problems

from dodo_dsl.diagnostics import Diagnostic
from tests.check import examples
from tests.emit.readers import run

RUN = "  - local: .gitlab/dodo/run.gitlab-ci.yml\n"


def said(folder: Path, text: str) -> list[Diagnostic]:
    (folder / ".git").mkdir(exist_ok=True)
    (folder / ".gitlab-ci.yml").write_text(text)
    (folder / "kiwi").mkdir(exist_ok=True)
    return problems(folder / "kiwi")


@pytest.mark.parametrize(
    "text",
    [
        f"include:\n{RUN}",
        f"include:\n{RUN}    inputs: {{variables: 3, rules: 3}}\nvariables: 3\n",
        "include: .gitlab/dodo/run.gitlab-ci.yml",
        "include: [",
        "include: [3, [], {component: 3}]",
        "variables: {DODO_REGISTRY: ''}",
    ],
)
def test_nothing_is_said(tmp_path: Path, text: str) -> None:
    assert said(tmp_path, text) == []


@pytest.mark.parametrize(
    "entry",
    [
        "local: .gitlab/dodo/deployment.gitlab-ci.yml",
        "component: $CI_SERVER_FQDN/team/dodo/deployment@1",
        "{project: team/dodo, file: templates/deployment/template.yml}",
    ],
)
def test_a_template_twice(tmp_path: Path, entry: str) -> None:
    (problem,) = said(tmp_path, f"include:\n  - {entry}\n  - {entry}\n")
    assert (problem.rule, problem.span.line) == ("pipeline-include", 3)


def test_one_job_twice_by_one_name(tmp_path: Path) -> None:
    (problem,) = said(tmp_path, f"include:\n{RUN}{RUN}")
    assert (problem.rule, problem.span.line) == ("pipeline-include", 3)
    assert problem.message.startswith("the template 'run' is included a second time")
    assert said(tmp_path, f"include:\n{RUN}{RUN}    inputs: {{job-name: night}}\n") == []


def test_variables_that_reach_nobody(tmp_path: Path) -> None:
    text = f"include:\n{RUN}variables: {{DODO_REGISTRY: '', DOCKER_HOST: tcp://docker:2375}}\n"
    (problem,) = said(tmp_path, text)
    assert problem.message.startswith("no job of DoDo's gets the variable 'DODO_REGISTRY'")
    assert said(tmp_path, text.replace("\nvar", "\n    inputs: {variables: [DODO_REGISTRY]}\nvar")) == []


def test_check_says_it_and_passes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    examples.write(examples.SPEC, tmp_path)
    (tmp_path / ".gitlab-ci.yml").write_text(f"include:\n{RUN}{RUN}")
    code, out, _ = run("compile", "--check")
    assert code == 0
    assert ".gitlab-ci.yml:3:5: warning[pipeline-include]" in out
