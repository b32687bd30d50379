"""Which jobs GitLab adds to which kind of pipeline: by ``rules`` and their expressions, ``only`` and ``except``.

What depends on files (``changes``, ``exists``) may hold, so that such a job may be there.

Sources: https://docs.gitlab.com/ci/jobs/job_rules/ and https://docs.gitlab.com/ci/yaml/deprecated_keywords/
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

Variables = Mapping[str, str]
Job = Mapping[str, Any]

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
    "CI_MERGE_REQUEST_SOURCE_BRANCH_NAME": "curve",
    "CI_MERGE_REQUEST_TARGET_BRANCH_NAME": "main",
    "CI_MERGE_REQUEST_PROJECT_PATH": "team/car",
    "CI_MERGE_REQUEST_SOURCE_PROJECT_PATH": "team/car",
    "CI_MERGE_REQUEST_EVENT_TYPE": "detached",
}
PUSH = {**_BRANCH, "CI_PIPELINE_SOURCE": "push"}
REVIEWED = {**PUSH, **_OPEN}
REQUEST = _REQUEST
CHILD_OF_REQUEST = {**_REQUEST, "CI_PIPELINE_SOURCE": "parent_pipeline"}
KINDS: Mapping[str, Variables] = {
    "push to a branch": PUSH,
    "push to a branch whose merge request is open": REVIEWED,
    "push to the default branch": {**_DEFAULT, "CI_PIPELINE_SOURCE": "push"},
    "push to the default branch, from which a merge request is open": {
        **_DEFAULT,
        **_OPEN,
        "CI_PIPELINE_SOURCE": "push",
    },
    "merge request": REQUEST,
    "merged result": {**_REQUEST, "CI_MERGE_REQUEST_EVENT_TYPE": "merged_result"},
    "merge train": {**_REQUEST, "CI_MERGE_REQUEST_EVENT_TYPE": "merge_train"},
    "merge request of a fork": {**_REQUEST, "CI_MERGE_REQUEST_SOURCE_PROJECT_PATH": "fork/car"},
    "tag": {**_MAIN, "CI_PIPELINE_SOURCE": "push", "CI_COMMIT_TAG": "v1.0", "CI_COMMIT_REF_NAME": "v1.0"},
    "schedule": {**_DEFAULT, "CI_PIPELINE_SOURCE": "schedule"},
    "another project's pipeline": {**_DEFAULT, "CI_PIPELINE_SOURCE": "pipeline"},
    "another project's pipeline, from main a merge request is open": {
        **_DEFAULT,
        **_OPEN,
        "CI_PIPELINE_SOURCE": "pipeline",
    },
    "trigger token": {**_DEFAULT, **_OPEN, "CI_PIPELINE_SOURCE": "trigger"},
    "API": {**_BRANCH, **_OPEN, "CI_PIPELINE_SOURCE": "api"},
    "web": {**_BRANCH, **_OPEN, "CI_PIPELINE_SOURCE": "web"},
    "child of a branch's pipeline": {**_BRANCH, **_OPEN, "CI_PIPELINE_SOURCE": "parent_pipeline"},
    "child of a merge request's pipeline": CHILD_OF_REQUEST,
}
"""The variables of each kind of pipeline by which rules recognise it; others are empty."""

_TOKEN = re.compile(
    r"""\s*(?:(?P<sign>\|\||&&|==|!=|=~|!~|\(|\))|\$(?P<variable>\w+)|"(?P<double>[^"]*)"|'(?P<single>[^']*)'"""
    r"""|/(?P<regex>(?:[^/\\]|\\.)*)/(?P<flags>\w*)|(?P<null>null)\b)"""
)
_COMPARED = ("==", "!=", "=~", "!~")
_KEYWORDS = {
    "merge_requests": "merge_request_event",
    "pushes": "push",
    "schedules": "schedule",
    "triggers": "trigger",
    "pipelines": "pipeline",
    "api": "api",
    "web": "web",
    "chat": "chat",
    "external": "external",
}


class Unreadable(Exception):
    """An expression or a keyword of another form than GitLab documents."""


class _Expression:
    """An ``if`` of GitLab's by recursive descent; a variable that is not there is null, which is false."""

    def __init__(self, text: str, variables: Variables) -> None:
        self._text = text
        self._variables = variables
        self._tokens = list(self._read(text))
        self._next = 0

    def value(self) -> bool:
        found = self._any()
        if self._next < len(self._tokens):
            raise Unreadable(self._text)
        return found

    def _read(self, text: str) -> Iterator[tuple[str, str]]:
        end, text = 0, text.strip()
        while end < len(text):
            found = _TOKEN.match(text, end)
            if not found:
                raise Unreadable(text)
            end = found.end()
            kind = next(kind for kind, value in found.groupdict().items() if value is not None)
            flags = "(?i)" if "i" in (found["flags"] or "") else ""
            yield (kind, flags + found[kind]) if kind == "regex" else (kind, found[kind])

    def _is_next(self, *signs: str) -> str:
        """The sign that comes next, which is taken, or nothing."""
        if self._next < len(self._tokens) and self._tokens[self._next] in [("sign", sign) for sign in signs]:
            self._next += 1
            return self._tokens[self._next - 1][1]
        return ""

    def _any(self) -> bool:
        found = self._all()
        while self._is_next("||"):
            found = self._all() or found
        return found

    def _all(self) -> bool:
        found = self._compared()
        while self._is_next("&&"):
            found = self._compared() and found
        return found

    def _compared(self) -> bool:
        if self._is_next("("):
            found = self._any()
            if not self._is_next(")"):
                raise Unreadable(self._text)
            return found
        left = self._operand()[1]
        sign = self._is_next(*_COMPARED)
        if not sign:
            return bool(left)
        kind, right = self._operand()
        if sign in ("==", "!="):
            return (left == right) is (sign == "==")
        return self._matches(left, kind, right) is (sign == "=~")

    def _operand(self) -> tuple[str, str | None]:
        if self._next >= len(self._tokens):
            raise Unreadable(self._text)
        kind, text = self._tokens[self._next]
        self._next += 1
        if kind == "sign":
            raise Unreadable(self._text)
        return kind, {"variable": self._variables.get(text), "null": None}.get(kind, text)

    def _matches(self, left: str | None, kind: str, right: str | None) -> bool:
        if kind == "variable" and (inner := re.fullmatch(r"/(.*)/(\w*)", right or "")):
            right = ("(?i)" if "i" in inner[2] else "") + inner[1]
        try:
            return left is not None and right is not None and bool(re.search(right, left))
        except re.error:
            raise Unreadable(self._text) from None


def holds(expression: str, variables: Variables) -> bool:
    """Whether an ``if`` holds; raises Unreadable."""
    return _Expression(expression, variables).value()


def is_made(workflow: Any, variables: Variables) -> bool:
    """Whether ``workflow: rules`` let GitLab make such a pipeline; without them it makes all that have a job."""
    rules = workflow.get("rules") if isinstance(workflow, Mapping) else None
    return rules is None or _by_rules(rules, variables)


def may_be_there(job: Job, variables: Variables, by_workflow: bool = False) -> bool:
    """Whether a job may be in such a pipeline; raises Unreadable.

    A job with neither ``rules`` nor ``only`` is in pipelines of branches and tags, and where a workflow has rules
    (``by_workflow``) in all that these make.
    """
    if job.get("rules") is not None:
        return _by_rules(job["rules"], variables)
    only = job.get("only")
    if only is None and "except" not in job and by_workflow:
        return True
    wanted = _by_refs(["branches", "tags"] if only is None else only, variables)
    return wanted and not ("except" in job and _by_refs(job["except"], variables))


def _by_rules(rules: Any, variables: Variables) -> bool:
    for rule in _flat(rules):
        if not isinstance(rule, Mapping):
            raise Unreadable(str(rule))
        never = rule.get("when") == "never"
        by_files = bool({"changes", "exists"} & rule.keys())
        if "if" in rule and not holds(str(rule["if"]), variables):
            continue
        if not (never and by_files):
            return not never
    return False


def _flat(rules: Any) -> Iterator[Any]:
    for rule in rules if isinstance(rules, list) else [rules]:
        yield from _flat(rule) if isinstance(rule, list) else [rule]


def _by_refs(words: Any, variables: Variables) -> bool:
    """``only`` or ``except``: a text, a list, or a mapping whose keys all have to hold."""
    if isinstance(words, Mapping):
        expressions = words.get("variables") or []
        return ("refs" not in words or _by_refs(words["refs"], variables)) and (
            not expressions or any(holds(str(expression), variables) for expression in _flat(expressions))
        )
    return any(_is_ref(str(word), variables) for word in _flat(words))


def _is_ref(word: str, variables: Variables) -> bool:
    word = word.partition("@")[0]
    source, ref = variables.get("CI_PIPELINE_SOURCE"), variables.get("CI_COMMIT_REF_NAME", "")
    if word in ("branches", "tags"):
        return bool(variables.get("CI_COMMIT_BRANCH" if word == "branches" else "CI_COMMIT_TAG"))
    if word in _KEYWORDS:
        return source == _KEYWORDS[word]
    if variables.get("CI_MERGE_REQUEST_ID"):
        return False  # its ref is none of a branch
    if pattern := re.fullmatch(r"/(.*)/(\w*)", word):
        try:
            return bool(re.search(pattern[1], ref, re.IGNORECASE if "i" in pattern[2] else 0))
        except re.error:  # GitLab's are RE2's
            raise Unreadable(word) from None
    return word == ref
