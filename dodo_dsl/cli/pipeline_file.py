"""DoDo's templates in a repository's own ``.gitlab-ci.yml``: each once, and with the variables that they need.

Which jobs are in which pipeline is GitLab's to say: ``glab ci lint --dry-run``, or *Build, Pipeline editor, Validate*.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.package_data import PIPELINES
from dodo_dsl.source import Mapping

FILE = ".gitlab-ci.yml"
_NAME = "|".join(PIPELINES)
_TEMPLATE = re.compile(rf"(?:dodo/({_NAME})\.gitlab-ci|templates/({_NAME})/template)\.ya?ml|dodo\S*/({_NAME})@")
"""Of a copy in the repository, of a file of DoDo's project, of a component."""


@dataclass(frozen=True)
class Included:
    """One of DoDo's templates, at its place, by the name of which GitLab keeps one, with the variables that it gets."""

    template: str
    name: str
    variables: Sequence[str]
    span: Span


def problems(root: Path) -> list[Diagnostic]:
    """Templates that take one another's place, and variables that reach no job, in the repository that has ``root``."""
    top = next((folder for folder in (root, *root.parents) if (folder / ".git").exists()), root)
    node, wrong = source.read(top / FILE) if (top / FILE).is_file() else (None, [])
    if wrong or not isinstance(node, Mapping):
        return []  # GitLab's own check says so
    included = list(_included(node))
    return [*_twice(included), *_unused(included, node)]


def _included(file: Mapping) -> Iterator[Included]:
    entry = file.get("include")
    for node in entry.items if isinstance(entry, source.Sequence) else (entry,):
        what = source.plain(node) if node is not None else {}
        given = {"local": what} if isinstance(what, str) else what if isinstance(what, dict) else {}
        found = _TEMPLATE.search(" ".join(str(given.get(key)) for key in ("local", "remote", "file", "component")))
        if node is None or not found:
            continue
        template = next(filter(None, found.groups()))
        inputs = given.get("inputs")
        inputs = inputs if isinstance(inputs, dict) else {}
        variables = inputs.get("variables")
        name = str(inputs.get("job-name", "dodo-run")) if template == "run" else template
        yield Included(template, name, variables if isinstance(variables, list) else (), node.span)


def _twice(included: Sequence[Included]) -> Iterator[Diagnostic]:
    for place, one in enumerate(included):
        if any((one.template, one.name) == (before.template, before.name) for before in included[:place]):
            message = (
                f"the template '{one.template}' is included a second time, and of jobs of one name GitLab keeps one"
            )
            hint = "give this one the input 'job-name'" if one.template == "run" else "include it once"
            yield Diagnostic(one.span, "pipeline-include", message, hint, "warning")


def _unused(included: Sequence[Included], file: Mapping) -> Iterator[Diagnostic]:
    reached = {str(name) for one in included for name in one.variables}
    variables = file.get("variables")
    for name in variables.entries if included and isinstance(variables, Mapping) else ():
        if name.startswith("DODO_") and name not in reached:
            message = f"no job of DoDo's gets the variable '{name}'; they get those that the input 'variables' names"
            hint = "there is an input for most; name others in the input 'variables'"
            yield Diagnostic(included[0].span, "pipeline-include", message, hint, "warning")
