"""The command that repeats a run, of options that carry no secrets."""

import argparse
import shlex
from collections.abc import Iterator

_VALUES = ("level", "backend", "jobs", "clock", "wall_timeout", "isolation", "seed", "compiled", "application")
"""Options with values that may be noted; whatever is not listed here is left out."""


def command_line(options: argparse.Namespace) -> str:
    """Of the options of ``dodo run``; how it is shown, watched and reported is left out."""
    return shlex.join(["dodo", "run", *options.test, *_flags(options)])


def _flags(options: argparse.Namespace) -> Iterator[str]:
    for name in _VALUES:
        given = getattr(options, name)
        values = given if isinstance(given, list) else [] if given is None else [given]
        for value in values:
            yield f"--{name.replace('_', '-')}"
            yield f"{value:g}" if isinstance(value, float) else str(value)
    if options.repeat != 1:
        yield from ("--repeat", str(options.repeat))
    if options.samples:
        yield from ("--samples", str(options.samples))
    if options.retry_errors:
        yield from ("--retry-errors", str(options.retry_errors))
    if options.fail_fast:
        yield "--fail-fast"
