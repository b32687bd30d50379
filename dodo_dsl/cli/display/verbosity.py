"""``-q`` and ``-v``: how much a command says."""

import argparse
import contextlib
import io
from collections.abc import Iterator
from enum import IntEnum
from typing import TextIO


class Verbosity(IntEnum):
    QUIET = -1
    NORMAL = 0
    VERBOSE = 1


def add(parser: argparse.ArgumentParser, quiet: str, verbose: str) -> None:
    """The two flags, with their help."""
    group = parser.add_mutually_exclusive_group()
    parser.set_defaults(verbosity=Verbosity.NORMAL)
    for flags, value, text in (
        (("-q", "--quiet"), Verbosity.QUIET, quiet),
        (("-v", "--verbose"), Verbosity.VERBOSE, verbose),
    ):
        group.add_argument(*flags, dest="verbosity", action="store_const", const=value, help=text)


@contextlib.contextmanager
def chatter(stream: TextIO, verbosity: Verbosity) -> Iterator[TextIO]:
    """A stream for what is not asked for with ``-q``; it is shown all the same when an error ends this."""
    if verbosity is not Verbosity.QUIET:
        yield stream
        return
    unsaid = io.StringIO()
    try:
        yield unsaid
    except Exception:
        stream.write(unsaid.getvalue())
        raise
