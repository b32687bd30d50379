"""Commands that need an extra of DoDo's, with what to type where it is missing."""

from dodo_dsl import advice
from dodo_dsl.cli.errors import UsageError


def require(what: str, extra: str) -> None:
    """Raises UsageError with a command where a module of the extra cannot be loaded."""
    if module := advice.missing(extra):
        raise UsageError(f"{what} needs {module}: {advice.install(extra)}")
