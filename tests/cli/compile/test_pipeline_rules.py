"""GitLab's ``rules``, ``only`` and ``except``, by what its documentation says of each."""

import pytest

from dodo_dsl.cli.pipeline_rules import KINDS, Unreadable, holds, is_made, may_be_there

VARIABLES = {"A": "a", "EMPTY": "", "CI_COMMIT_BRANCH": "main", "PATTERN": "/^A$/i"}


@pytest.mark.parametrize(
    "expression",
    [
        "$A",
        '$A == "a"',
        "'a' == $A",
        '$A != "b"',
        "$NONE == null",
        '$EMPTY == ""',
        '$NONE != ""',
        "$A =~ /^a/",
        "$A =~ /^A/i",
        "$A !~ /b/",
        "$NONE !~ /b/",
        "$A =~ $PATTERN",
        r'$CI_COMMIT_BRANCH =~ /^m\w+n$/',
        '$NONE && $A || $CI_COMMIT_BRANCH == "main"',
        '$A || $NONE && $NONE',
        '($A || $NONE) && $A == "a"',
        '$A =~ /a\\/?/ && ($A == "a")',
    ],
)  # fmt: skip
def test_it_holds(expression: str) -> None:
    assert holds(expression, VARIABLES)


@pytest.mark.parametrize(
    "expression",
    ["$NONE", "$EMPTY", '$NONE == ""', "$A == null", "$NONE =~ /./", "($A || $NONE) && $NONE", '$A == "a" && $EMPTY'],
)
def test_it_does_not_hold(expression: str) -> None:
    assert not holds(expression, VARIABLES)


@pytest.mark.parametrize(
    "expression", ["", "$A ==", "($A", "$A $A", "$A = 'a'", "&& $A", "$A =~ /(/", "$[[ inputs.x ]]"]
)
def test_other_forms_are_unreadable(expression: str) -> None:
    with pytest.raises(Unreadable):
        holds(expression, VARIABLES)


def there(job: object, by_workflow: bool = False) -> set[str]:
    return {kind for kind, variables in KINDS.items() if may_be_there(job, variables, by_workflow)}  # type: ignore[arg-type]


REQUESTS = {"merge request", "merged result", "merge train", "merge request of a fork"}
OF_REQUESTS = REQUESTS | {"child of a merge request's pipeline"}


def test_a_job_without_rules_is_where_branches_and_tags_are() -> None:
    assert there({}) == KINDS.keys() - OF_REQUESTS
    assert there({}, by_workflow=True) == set(KINDS)
    assert there({"only": ["branches", "tags"]}, by_workflow=True) == KINDS.keys() - OF_REQUESTS


def test_only_and_except() -> None:
    assert there({"only": ["merge_requests"]}) == REQUESTS
    assert there({"only": "tags"}) == {"tag"}
    assert there({"except": ["branches"]}) == {"tag"}
    assert there({"only": {"refs": ["schedules", "/^v/"], "variables": ["$NONE", "$CI_COMMIT_TAG =~ /^v/"]}}) == {"tag"}
    assert there({"only": ["main@team/car"], "except": ["pushes"]}) == {
        "schedule", "trigger token", "another project's pipeline",
        "another project's pipeline, from main a merge request is open",
    }  # fmt: skip


def test_the_first_rule_that_matches_counts() -> None:
    never = {"if": '$CI_PIPELINE_SOURCE == "push"', "when": "never"}
    assert "push to a branch" not in there({"rules": [never, {"when": "always"}]})
    assert "tag" not in there({"rules": [[never], {"if": "$CI_COMMIT_TAG"}]})
    assert there({"rules": []}) == set()
    files = {"changes": ["src/**"], "when": "never"}
    assert there({"rules": [files, {"changes": ["src/**"]}]}) == set(KINDS), "it may be"


def test_a_workflow_makes_what_its_rules_say() -> None:
    assert is_made(None, KINDS["tag"]) and is_made({"name": "x"}, KINDS["tag"])
    assert not is_made({"rules": [{"if": "$CI_COMMIT_BRANCH"}]}, KINDS["tag"])
