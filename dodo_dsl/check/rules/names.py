"""``name-differs``: a test's name equals its file's; ``name-taken``: it is unique.

``name-reserved``: a test is a job of its name, and GitLab reads some names as keywords.
"""

import re
from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, shown_path

KEYWORDS = frozenset(
    {
        "after-script",
        "before-script",
        "cache",
        "default",
        "false",
        "gate",
        "image",
        "include",
        "nil",
        "pages",
        "services",
        "spec",
        "stages",
        "true",
        "types",
        "variables",
        "workflow",
    }
)

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


def check(context: RuleContext) -> Iterator[Diagnostic]:
    spec = context.spec
    if spec.name is None:
        return
    if spec.name in KEYWORDS:
        message = f"'{spec.name}' is a keyword of GitLab's pipelines and cannot name a job"
        yield Diagnostic(spec.span("name"), "name-reserved", message, f"for example 'sil-{spec.name}'")
    stem = spec.location.stem
    if spec.name != stem and _NAME.fullmatch(spec.name):  # the schema says what is wrong with any other
        message = f"the name '{spec.name}' differs from the file's name"
        yield Diagnostic(spec.span("name"), "name-differs", message, f"write 'name: {stem}' or rename the file")
    others = [other for other in context.by_name[spec.name] if other.path != spec.path]
    if others:
        message = f"the name '{spec.name}' is taken by {shown_path(str(others[0].path))}"
        yield Diagnostic(spec.span("name"), "name-taken", message, "names are unique across all registries")
