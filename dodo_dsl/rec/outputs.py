"""Results replace existing files only with ``--force``, and nothing else ever."""

from collections.abc import Iterable
from pathlib import Path

from dodo_dsl import atomic


class OutputExists(Exception):
    """A result would replace an existing file; one sentence."""


def refuse_existing(paths: Iterable[Path], force: bool) -> None:
    """Raises OutputExists for the first path that is there, unless it is a file and ``force`` is given."""
    for path in paths:
        try:
            atomic.refuse_others(path)
        except (atomic.NotReplaceable, IsADirectoryError) as error:
            raise OutputExists(f"'{path}' cannot take the result: {error.strerror}") from None
        if not force and path.exists():
            raise OutputExists(f"'{path}' exists already; --force replaces it")
