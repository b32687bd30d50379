"""``wrong-file``: what is in the files that parameters name, read as the services read it, at the place in the file."""

import functools
from collections.abc import Iterator, Mapping
from pathlib import Path

from dodo_dsl.check.context import RuleContext
from dodo_dsl.check.replayed import known_ids
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.opendlv.inputs import formats
from dodo_dsl.opendlv.inputs.problem import InputError
from dodo_dsl.spec.arguments import Argument, ResolvedService
from dodo_dsl.spec.registry import SUFFIX

RULE = "wrong-file"
_TEXT = (".json", ".csv", ".obj", ".yml", ".yaml")
"""Endings of files whose lines can be shown."""


def check(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        if service.use.layer not in service.manifest.layers:
            continue
        for argument in service.arguments.values():
            yield from file_problems(context, service, argument)


def is_own(diagnostic: Diagnostic) -> bool:
    """Whether a problem is one of a file that several tests name, and the same in each of them."""
    return diagnostic.rule == RULE and not diagnostic.span.file.endswith(SUFFIX)


def file_problems(context: RuleContext, service: ResolvedService, argument: Argument) -> tuple[Diagnostic, ...]:
    """The problems of the file that a parameter names; none without a format."""
    name, path = argument.parameter.format, argument.value.path if argument.value else None
    if not name or path is None:
        return ()
    given = tuple((key, service.texts.get(key, "")) for key in formats.SETTINGS.get(name, ()))
    return problems(name, path, given, context.deployment.messages)


@functools.lru_cache(maxsize=1024)
def problems(
    name: str, path: Path, given: tuple[tuple[str, str], ...], own: tuple[Path, ...]
) -> tuple[Diagnostic, ...]:
    """The problems of a file of a format, for parameters of the service and files with messages."""
    ids: Mapping[str, int] = known_ids(own)
    return tuple(
        _diagnostic(error, formats.HELP.get(name, "")) for error in formats.problems(name, path, dict(given), ids)
    )


def _diagnostic(error: InputError, help_: str) -> Diagnostic:
    line, column = error.position()
    is_text = error.file.suffix in _TEXT
    span = Span(str(error.file), line, column, 1 if is_text else 0)
    return Diagnostic(span, RULE, error.what, error.hint or help_, "warning" if error.is_slip else "error")
