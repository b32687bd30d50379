"""``name-differs``: a test's name equals its file's; ``name-taken``: it is unique.

``name-reserved``: a test is a job of its name, and GitLab reads some names as keywords.
"""

from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, shown_path
from dodo_dsl.spec.names import KEYWORDS, as_file, is_free, is_name
from dodo_dsl.spec.registry import SUFFIX


def check(context: RuleContext) -> Iterator[Diagnostic]:
    spec = context.spec
    if spec.name is None:
        return
    if spec.name in KEYWORDS:
        message = f"'{spec.name}' is a keyword of GitLab's pipelines and cannot name a job"
        yield Diagnostic(spec.span("name"), "name-reserved", message, as_file(spec.location.stem, SUFFIX))
    elif spec.name != spec.location.stem and is_name(spec.name):  # the schema says what is wrong with any other
        message, stem = f"the name '{spec.name}' differs from the file's name", spec.location.stem
        written = f"write 'name: {stem}', or " if is_free(stem) else ""
        hint = f"{written}rename the file to {spec.name}{SUFFIX}"
        yield Diagnostic(spec.span("name"), "name-differs", message, hint)
    others = [other for other in context.by_name[spec.name] if other.path != spec.path]
    if others:
        message = f"the name '{spec.name}' is taken by {shown_path(str(others[0].path))}"
        yield Diagnostic(spec.span("name"), "name-taken", message, "names are unique across all registries")
