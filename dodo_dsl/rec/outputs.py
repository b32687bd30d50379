"""Results replace existing files only with ``--force``."""

from collections.abc import Iterable
from pathlib import Path


class OutputExists(Exception):
    """A result would replace an existing file; one sentence."""


def refuse_existing(paths: Iterable[Path], force: bool) -> None:
    """Raises OutputExists for the first existing path, unless ``force``."""
    for path in paths:
        if not force and path.exists():
            raise OutputExists(f"'{path}' exists already; --force replaces it")
