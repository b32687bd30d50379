"""Which pipelines GitLab makes, and which jobs it adds, by ``rules`` of the form that DoDo's templates have.

gitlab-ci-local reads them alike (``test_foreign.py``). Source: https://docs.gitlab.com/ci/jobs/job_rules/
"""

import re
from collections.abc import Mapping
from typing import Any

Variables = Mapping[str, str]

_MAIN = {"CI_DEFAULT_BRANCH": "main"}
_BRANCH = {**_MAIN, "CI_COMMIT_BRANCH": "curve", "CI_COMMIT_REF_NAME": "curve"}
_DEFAULT = {**_MAIN, "CI_COMMIT_BRANCH": "main", "CI_COMMIT_REF_NAME": "main"}
_OPEN = {"CI_OPEN_MERGE_REQUESTS": "team/car!7"}
_REQUEST = {
    **_MAIN,
    **_OPEN,
    "CI_PIPELINE_SOURCE": "merge_request_event",
    "CI_COMMIT_REF_NAME": "curve",
    "CI_MERGE_REQUEST_ID": "70",
    "CI_MERGE_REQUEST_IID": "7",
    "CI_MERGE_REQUEST_TARGET_BRANCH_NAME": "main",
}
_PUSH, _PIPELINE = {"CI_PIPELINE_SOURCE": "push"}, {"CI_PIPELINE_SOURCE": "pipeline"}
_CHILD = {"CI_PIPELINE_SOURCE": "parent_pipeline"}
KINDS: Mapping[str, Variables] = {
    "push to a branch": {**_BRANCH, **_PUSH},
    "push to a branch whose merge request is open": {**_BRANCH, **_OPEN, **_PUSH},
    "push to the default branch": {**_DEFAULT, **_PUSH},
    "push to the default branch, from which a merge request is open": {**_DEFAULT, **_OPEN, **_PUSH},
    "merge request": _REQUEST,
    "merged result": {**_REQUEST, "CI_MERGE_REQUEST_EVENT_TYPE": "merged_result"},
    "merge train": {**_REQUEST, "CI_MERGE_REQUEST_EVENT_TYPE": "merge_train"},
    "merge request of a fork": {**_REQUEST, "CI_MERGE_REQUEST_SOURCE_PROJECT_PATH": "fork/car"},
    "tag": {**_MAIN, **_PUSH, "CI_COMMIT_TAG": "v1.0", "CI_COMMIT_REF_NAME": "v1.0"},
    "schedule": {**_DEFAULT, "CI_PIPELINE_SOURCE": "schedule"},
    "another project's pipeline": {**_DEFAULT, **_PIPELINE},
    "another project's pipeline, from main a merge request is open": {**_DEFAULT, **_OPEN, **_PIPELINE},
    "trigger token": {**_DEFAULT, **_OPEN, "CI_PIPELINE_SOURCE": "trigger"},
    "API": {**_BRANCH, **_OPEN, "CI_PIPELINE_SOURCE": "api"},
    "web": {**_BRANCH, **_OPEN, "CI_PIPELINE_SOURCE": "web"},
    "child of a branch's pipeline": {**_BRANCH, **_OPEN, **_CHILD},
    "child of a merge request's pipeline": {**_REQUEST, **_CHILD},
}
"""The variables of each kind of pipeline by which rules recognise it; others are empty."""

_TOKEN = re.compile(r'\s*(?:(?P<sign>\|\||&&|==|!=)|\$(?P<variable>\w+)|"(?P<text>[^"]*)")')


def holds(expression: str, variables: Variables) -> bool:
    """Whether an ``if`` of comparisons with ``&&`` and ``||`` holds; a variable that is not there is null."""
    words = {"||": "or", "&&": "and"}
    python = "".join(
        f" {words.get(found['sign'], found['sign'])} "
        if found["sign"]
        else repr(variables.get(found["variable"]) if found["variable"] else found["text"])
        for found in _TOKEN.finditer(expression)
    )
    assert not _TOKEN.sub("", expression).strip(), expression
    return bool(eval(python))


def is_made(workflow: Any, variables: Variables) -> bool:
    """Whether ``workflow: rules`` let GitLab make such a pipeline; without them it makes all that have a job."""
    return workflow is None or _first(workflow["rules"], variables)


def may_be_there(job: Mapping[str, Any], variables: Variables, by_workflow: bool = False) -> bool:
    """Whether a job may be in such a pipeline: without rules in those of branches and tags, or of a workflow."""
    if "rules" in job:
        return _first(job["rules"], variables)
    return by_workflow or bool({"CI_COMMIT_BRANCH", "CI_COMMIT_TAG"} & variables.keys())


def _first(rules: list[Mapping[str, Any]], variables: Variables) -> bool:
    found = (rule for rule in rules if holds(str(rule.get("if", '"1"')), variables))
    return next((rule.get("when") != "never" for rule in found), False)
