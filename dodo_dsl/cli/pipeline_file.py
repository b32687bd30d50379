"""A repository's own ``.gitlab-ci.yml`` around DoDo's templates: whose jobs are in which pipeline, as far as it says.

What other files may add, such as those of other projects, is not read, and nothing is said that depends on it.
"""

import contextlib
import functools
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl import package_data, source
from dodo_dsl.cli.new_files import PIPELINES
from dodo_dsl.cli.pipeline_rules import (
    CHILD_OF_REQUEST,
    PUSH,
    REQUEST,
    REVIEWED,
    Unreadable,
    Variables,
    is_made,
    may_be_there,
)
from dodo_dsl.diagnostics import Diagnostic, Span, listed

FILE = ".gitlab-ci.yml"
_KEYWORDS = ("default", "variables", "workflow", "include", "spec", "stages", "image", "services", "cache")
_OWN = ("script", "trigger", "extends", "run")
_NAME = "|".join(PIPELINES)
_TEMPLATE = re.compile(rf"(?:dodo/(?P<copy>{_NAME})\.gitlab-ci|templates/(?P<file>{_NAME})/template)\.ya?ml")
_COMPONENT = re.compile(rf"dodo\S*/(?P<component>{_NAME})@")
_WITHOUT_WORKFLOW = ("Jobs/", "Security/")
_DEPTH = 10


@dataclass(frozen=True)
class Included:
    """One of DoDo's templates, at its place, with the inputs that it gets."""

    template: str
    inputs: Mapping[str, Any]
    span: Span

    @property
    def name(self) -> str:
        """What GitLab keeps only one of."""
        return str(self.inputs.get("job-name", "dodo-run")) if self.template == "run" else self.template


@dataclass
class PipelineFile:
    """The file with those of the repository that it includes; ``complete`` unless others may say more of workflows."""

    config: dict[str, Any] = field(default_factory=dict)
    included: list[Included] = field(default_factory=list)
    complete: bool = True
    _read: set[Path] = field(default_factory=set)

    @property
    def says_all(self) -> bool:
        """Whether it says which pipelines there are: no file that is not read has a workflow that counts."""
        return bool(self.included) and (self.complete or "workflow" in self.config)

    def add(self, path: Path, top: Path, depth: int = 0) -> None:
        """Reads a file of the repository at ``top``, first what it includes."""
        path = path.resolve()
        inside = path.is_relative_to(top.resolve()) and path.is_file() and depth <= _DEPTH and path not in self._read
        self._read.add(path)
        node, wrong = source.read(path) if inside else (None, [])
        if not isinstance(node, source.Mapping) or wrong:
            self.complete = False
            return
        if entry := node.entries.get("include"):
            several = entry.value.items if isinstance(entry.value, source.Sequence) else (entry.value,)
            for one in several:
                self._include(one, top, depth)
        whole = {key: _plain(entry.value, node) for key, entry in node.entries.items() if key != "include"}
        self.config = _merged(self.config, whole)

    def _include(self, node: source.Node, top: Path, depth: int) -> None:
        what = source.plain(node)
        entry = {"local": what} if isinstance(what, str) else what
        if not isinstance(entry, dict):
            self.complete = False
        elif template := _template(entry):
            inputs = entry.get("inputs")
            self.included.append(Included(template, inputs if isinstance(inputs, dict) else {}, node.span))
        elif isinstance(entry.get("local"), str) and not {"rules", "inputs"} & entry.keys():
            self.add(top / entry["local"].lstrip("/"), top, depth + 1)
        elif not str(entry.get("template", "")).startswith(_WITHOUT_WORKFLOW):
            self.complete = False


def pipeline_file(root: Path) -> PipelineFile | None:
    """The pipeline of the repository that ``root`` is in, or None if there is none."""
    top = _top(root)
    return read(top / FILE) if (top / FILE).is_file() else None


def _top(root: Path) -> Path:
    return next((folder for folder in (root, *root.parents) if (folder / ".git").exists()), root)


def read(path: Path) -> PipelineFile:
    """A file in the top folder of its repository, with those of the repository that it includes."""
    found = PipelineFile()
    found.add(path, path.parent)
    return found


def problems(root: Path) -> list[Diagnostic]:
    """What in the pipeline of the repository runs in addition to DoDo's jobs, or their settings."""
    found = pipeline_file(root)
    if found is None:
        return []
    said = [*_twice(found.included), *_unused(found), *_apart(found)]
    for child in _children(found, root):
        said += [*_twice(child.included), *_unused(child), *_untested(child, CHILD_OF_REQUEST)]
    return said


def _children(found: PipelineFile, root: Path) -> Iterator[PipelineFile]:
    """The files of the repository that jobs trigger as child pipelines, those of folders in a repository of many."""
    jobs = [job for job in found.config.values() if isinstance(job, dict)]
    for trigger in (job["trigger"] for job in jobs if isinstance(job.get("trigger"), dict)):
        several = trigger.get("include")
        for one in several if isinstance(several, list) else [several]:
            local = one if isinstance(one, str) else one.get("local") if isinstance(one, dict) else None
            if local:
                child = PipelineFile()
                child.add(_top(root) / str(local).lstrip("/"), _top(root))
                yield child


def _twice(included: Sequence[Included]) -> Iterator[Diagnostic]:
    for place, one in enumerate(included):
        if any((one.template, one.name) == (before.template, before.name) for before in included[:place]):
            message = (
                f"the template '{one.template}' is included a second time, and of jobs of one name GitLab keeps one"
            )
            hint = "give this one the input 'job-name'" if one.template == "run" else "include it once"
            yield Diagnostic(one.span, "pipeline-include", message, hint, "warning")


def _unused(found: PipelineFile) -> Iterator[Diagnostic]:
    lists = [one.inputs.get("variables") for one in found.included]
    names = [str(name) for several in lists if isinstance(several, list) for name in several]
    variables = found.config.get("variables")
    for name in variables if found.included and isinstance(variables, dict) else ():
        if name.startswith("DODO_") and name not in names:
            message = f"no job of DoDo's gets the variable '{name}'; they get those that the input 'variables' names"
            hint = "there is an input for most; name others in the input 'variables'"
            yield Diagnostic(found.included[0].span, "pipeline-include", message, hint, "warning")


def _apart(found: PipelineFile) -> Iterator[Diagnostic]:
    """A merge request's pipeline with jobs of one side alone, at the template that is included first."""
    if not found.says_all:
        return
    with contextlib.suppress(Unreadable):
        tested = [one for one in found.included if _has_dodo(one, found, REQUEST)]
        missing = (_jobs(found, PUSH) | _jobs(found, REVIEWED)) - _jobs(found, REQUEST)
        if tested and missing:
            message = (
                f"a merge request's pipeline has DoDo's jobs but not {_named(missing)}, which only the branch's has"
            )
            hint = "join the branch's with the input 'rules: joined', or let 'workflow: rules' make one for both"
            yield Diagnostic(tested[0].span, "pipeline-jobs", message, hint, "warning")
    yield from _untested(found, REQUEST)


def _untested(found: PipelineFile, request: Variables) -> Iterator[Diagnostic]:
    """A merge request's pipeline, or a child of it, with the team's jobs alone, though nobody asked for that."""
    joined = [one for one in found.included if one.inputs.get("rules", "joined") == "joined"]
    if not (joined and found.says_all):
        return
    with contextlib.suppress(Unreadable):
        own = _jobs(found, request)
        if own and not any(_has_dodo(one, found, request) for one in found.included):
            kind = (
                "a child of a merge request's pipeline" if request is CHILD_OF_REQUEST else "a merge request's pipeline"
            )
            message = f"{kind} has {_named(own)} and no job of DoDo's, so it tests nothing"
            hint = "give the input 'rules: merge-requests', or let 'workflow: rules' make one for both"
            yield Diagnostic(joined[0].span, "pipeline-jobs", message, hint, "warning")


def _named(jobs: Collection[str]) -> str:
    most = 3
    more = [f"{len(jobs) - most} more"] if len(jobs) > most else []
    return listed([*(f"'{job}'" for job in sorted(jobs)[:most]), *more])


def _jobs(found: PipelineFile, variables: Variables) -> set[str]:
    """The team's jobs in such a pipeline, but those that run by hand, and those that extend what is not read."""
    if not is_made(found.config.get("workflow"), variables):
        return set()
    return {
        name
        for name, value in found.config.items()
        if isinstance(value, dict) and not name.startswith((".", "dodo-")) and name not in (*_KEYWORDS, "compile")
        if set(_OWN) & value.keys() and (job := _extended(name, found.config)) is not None
        if not _is_by_hand(job) and may_be_there(job, variables, by_workflow=_has_rules(found))
    }


def _is_by_hand(job: Mapping[str, Any]) -> bool:
    """Whether it runs at somebody's command alone, so that no pipeline waits for it unasked."""
    when = [rule.get("when") for rule in job.get("rules") or () if isinstance(rule, dict)]
    return job.get("when") == "manual" or ("manual" in when and set(when) <= {"manual", "never"})


def _has_dodo(one: Included, found: PipelineFile, variables: Variables) -> bool:
    """Whether a template's jobs are in such a pipeline, by its input or the team's own rules for them."""
    if not is_made(found.config.get("workflow"), variables):
        return False
    own = found.config.get(one.name if one.template == "run" else ".dodo-rules") or {}
    chosen = _choices(one.template).get(str(one.inputs.get("rules", "joined")))
    if chosen is None or not isinstance(own, dict):
        raise Unreadable(f"{one.inputs.get('rules')}, {own}")
    return may_be_there({**chosen, **own}, variables, by_workflow=_has_rules(found))


def _has_rules(found: PipelineFile) -> bool:
    workflow = found.config.get("workflow")
    return isinstance(workflow, dict) and "rules" in workflow


@functools.cache
def _choices(template: str) -> dict[str, dict[str, Any]]:
    """What the input ``rules`` means, by its values."""
    text = (package_data.templates() / template / "template.yml").read_text(encoding="utf-8")
    _, body = yaml.safe_load_all(text)
    mark = ".dodo-in-"
    return {name.removeprefix(mark): job for name, job in body.items() if name.startswith(mark)}


def _template(entry: Mapping[str, Any]) -> str:
    """The name of the template of DoDo's that an ``include`` names, or nothing."""
    files = entry.get("file")
    paths = [entry.get("local"), entry.get("remote"), *(files if isinstance(files, list) else [files])]
    for path in paths:
        if found := _TEMPLATE.search(str(path)):
            return found["copy"] or found["file"]
    found = _COMPONENT.search(str(entry.get("component")))
    return found["component"] if found else ""


def _plain(node: source.Node, root: source.Mapping, depth: int = 0) -> Any:
    """The value of a node, with what ``!reference`` refers to in the same file."""
    if isinstance(node, source.Mapping):
        return {key: _plain(entry.value, root, depth) for key, entry in node.entries.items()}
    if not isinstance(node, source.Sequence):
        return source.plain(node)
    if node.tag != "!reference":
        return [value for item in node.items for value in _spliced(item, root, depth)]
    target: source.Node = root
    for key in source.plain(node):
        entry = target.entries.get(key) if isinstance(target, source.Mapping) else None
        if entry is None or depth > _DEPTH:
            return "!reference"  # of another file, which no rule is
        target = entry.value
    return _plain(target, root, depth + 1)


def _spliced(item: source.Node, root: source.Mapping, depth: int) -> list[Any]:
    """An item of a list; a list that it refers to is a part of this one."""
    value = _plain(item, root, depth)
    return value if isinstance(value, list) and getattr(item, "tag", "") == "!reference" else [value]


def _extended(name: str, config: Mapping[str, Any], depth: int = 0) -> dict[str, Any] | None:
    """A job with what it extends; None if that is in a file that is not read."""
    job = config.get(name)
    if not isinstance(job, dict) or depth > _DEPTH:
        return None
    above = job.get("extends", [])
    made: dict[str, Any] = {}
    for parent in [above] if isinstance(above, str) else above:
        found = _extended(str(parent), config, depth + 1)
        if found is None:
            return None
        made = _merged(made, found)
    return _merged(made, {key: value for key, value in job.items() if key != "extends"})


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """As GitLab merges files and jobs: mappings key by key, all else by what comes last."""
    both = below.keys() & above.keys()
    maps = {key for key in both if isinstance(below[key], dict) and isinstance(above[key], dict)}
    return {**below, **above, **{key: _merged(below[key], above[key]) for key in maps}}
