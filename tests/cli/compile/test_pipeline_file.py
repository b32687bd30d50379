"""What ``dodo compile --check`` says of a repository's own pipeline around DoDo's templates."""

from pathlib import Path

import pytest

from dodo_dsl.cli.pipeline_file import problems
from dodo_dsl.diagnostics import Diagnostic
from tests.check import examples
from tests.emit.readers import run

RUN = "  - local: .gitlab/dodo/run.gitlab-ci.yml\n"
REQUESTS = f"{RUN}    inputs: {{rules: merge-requests}}\n"
WORKFLOW = 'workflow: {rules: [{if: $CI_PIPELINE_SOURCE == "merge_request_event"}, {if: $CI_COMMIT_TAG}]}\n'
BUILD = "build: {script: [make]}\n"
IN_REQUESTS = 'lint: {script: [lint], rules: [{if: $CI_PIPELINE_SOURCE == "merge_request_event"}]}\n'


def said(folder: Path, text: str, **files: str) -> list[Diagnostic]:
    (folder / ".git").mkdir(exist_ok=True)
    (folder / ".gitlab-ci.yml").write_text(text)
    for name, content in files.items():
        (folder / f"{name}.yml").write_text(content)
    (folder / "kiwi").mkdir(exist_ok=True)
    return problems(folder / "kiwi")


def test_dodo_s_jobs_alone_in_a_merge_request(tmp_path: Path) -> None:
    (problem,) = said(tmp_path, f"include:\n{REQUESTS}{BUILD}test: {{extends: .x, script: [a]}}\n.x: {{stage: test}}\n")
    assert (problem.rule, problem.severity, problem.span.line) == ("pipeline-jobs", "warning", 2)
    assert problem.message == (
        "a merge request's pipeline has DoDo's jobs but not 'build' and 'test', which only the branch's has"
    )
    assert "'rules: joined'" in problem.hint and "'workflow: rules'" in problem.hint


@pytest.mark.parametrize(
    "text",
    [
        f"include:\n{RUN}{BUILD}",
        f"include:\n{REQUESTS}{BUILD}{WORKFLOW}",
        f"include:\n{REQUESTS}deploy: {{script: [a], only: [main]}}\n",
        f"include:\n{REQUESTS}flash: {{script: [a], when: manual}}\n",
        f"include:\n{REQUESTS}",
        f"include:\n{REQUESTS}{BUILD}dodo-run: {{rules: [{{if: $CI_COMMIT_BRANCH}}]}}\n",
        BUILD,
        "include: [",
        f"include:\n{REQUESTS}deploy: {{script: [a], only: ['/^v[0-9]+\\z/']}}\n",
        f"include:\n{REQUESTS}deploy: {{script: [a], except: ['/^(?i)rel/']}}\n",
        f"include:\n{RUN}    inputs: {{variables: 3, rules: 3}}\nvariables: 3\n",
        f"include:\n{REQUESTS}{BUILD}dodo-run: [a]\n",
        f"include:\n  - .gitlab-ci.yml\n  - .gitlab-ci.yml\n{REQUESTS}{BUILD}",
    ],
)
def test_nothing_is_said_where_both_are_there(tmp_path: Path, text: str) -> None:
    assert said(tmp_path, text) == []


def test_a_merge_request_without_a_test(tmp_path: Path) -> None:
    (problem,) = said(tmp_path, f"include:\n{RUN}{IN_REQUESTS}")
    assert problem.message == "a merge request's pipeline has 'lint' and no job of DoDo's, so it tests nothing"
    assert said(tmp_path, f"include:\n{RUN}    inputs: {{rules: branches}}\n{IN_REQUESTS}") == [], "it is asked for"


def test_a_child_of_a_merge_request_without_a_test(tmp_path: Path) -> None:
    parent = "kiwi: {trigger: {include: [{local: /child.yml}], strategy: depend}}\n"
    rules = "{script: [make], rules: [{when: on_success}]}\n"
    (problem,) = said(tmp_path, parent, child=f"include:\n{RUN}build: {rules}")
    assert problem.message.startswith("a child of a merge request's pipeline has 'build' and no job of DoDo's")
    assert problem.span.file.endswith("child.yml")
    assert said(tmp_path, parent, child=f"include:\n{REQUESTS}build: {rules}") == []
    assert said(tmp_path, parent, child=f"include:\n{RUN}{BUILD}workflow: {{rules: [{{when: always}}]}}\n") == []


@pytest.mark.parametrize(
    "other",
    [
        "{remote: 'https://example.org/ci.yml'}",
        "{project: team/ci, file: all.yml}",
        "{component: $CI_SERVER_FQDN/team/build/gcc@1}",
        "{local: none.yml}",
        "{local: ../other.yml}",
        "{template: Workflows/Branch-Pipelines.gitlab-ci.yml}",
    ],
)
def test_nothing_is_said_of_what_other_files_decide(tmp_path: Path, other: str) -> None:
    assert said(tmp_path, f"include:\n{REQUESTS}  - {other}\n{BUILD}") == []
    assert said(tmp_path, f"include:\n{REQUESTS}  - template: Jobs/SAST.gitlab-ci.yml\n{BUILD}") != []


def test_files_of_the_repository_are_read(tmp_path: Path) -> None:
    text = f"include:\n{REQUESTS}  - local: build.yml\n"
    assert "'build'" in said(tmp_path, text, build=BUILD)[0].message
    assert said(tmp_path, text, build=f"{BUILD}{WORKFLOW}") == []
    assert said(tmp_path, text, build="include: [local: build.yml]\n") == [], "one that includes itself"
    refers = ".x: {r: [{if: $CI_COMMIT_BRANCH}]}\nbuild: {script: [a], rules: [!reference [.x, r]]}\n"
    assert "'build'" in said(tmp_path, text, build=refers)[0].message
    assert said(tmp_path, text, build="build: {script: [a], extends: .elsewhere}\n") == []
    assert said(tmp_path, text, build="build: {script: [a], rules: [{if: $A = $B}]}\n") == [], "unreadable"


def test_components_and_projects_are_dodo_s_by_their_name(tmp_path: Path) -> None:
    component = "  - component: $CI_SERVER_FQDN/team/dodo/deployment@1\n    inputs: {rules: merge-requests}\n"
    project = "  - {project: team/dodo, file: templates/application/template.yml, inputs: {rules: merge-requests}}\n"
    for entry in (component, project):
        assert "'build'" in said(tmp_path, f"include:\n{entry}{BUILD}")[0].message


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
    (tmp_path / ".gitlab-ci.yml").write_text(f"include:\n{REQUESTS}{BUILD}")
    code, out, _ = run("compile", "--check")
    assert code == 0
    assert ".gitlab-ci.yml:2:5: warning[pipeline-jobs]: a merge request's pipeline has DoDo's jobs" in out
