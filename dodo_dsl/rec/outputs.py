"""Results do not take the place of what is there, unless they are told to."""

from collections.abc import Iterable
from pathlib import Path


class OutputExists(Exception):
    """A result would replace what is there; one sentence."""


def refuse_existing(paths: Iterable[Path], force: bool) -> None:
    """Raises OutputExists for the first path that is there, unless ``force``."""
    for path in paths:
        if not force and path.exists():
            raise OutputExists(f"{path} is there already; --force replaces it")
