"""``name-differs``: a test's name equals its file's; ``name-taken``: it is unique."""

from collections.abc import Iterator

from dodo_dsl.check.context import Context
from dodo_dsl.diagnostics import Diagnostic, shown_path


def check(context: Context) -> Iterator[Diagnostic]:
    spec = context.spec
    if spec.name is None:
        return
    stem = spec.location.stem
    if spec.name != stem:
        message = f"the name '{spec.name}' differs from the file's name"
        yield Diagnostic(spec.span("name"), "name-differs", message, f"write 'name: {stem}' or rename the file")
    others = [other for other in context.by_name[spec.name] if other.path != spec.path]
    if others:
        message = f"the name '{spec.name}' is taken by {shown_path(str(others[0].path))}"
        yield Diagnostic(spec.span("name"), "name-taken", message, "names are unique over all registries")
