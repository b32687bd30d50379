"""Results that appear whole or not at all: written beside their place, moved there at the end."""

import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path


class OutputExists(Exception):
    """A result would replace what is there; one sentence."""


def refuse_existing(paths: Iterable[Path], force: bool) -> None:
    """Raises OutputExists for the first path that is there, unless `force`."""
    for path in paths:
        if not force and path.exists():
            raise OutputExists(f"{path} is there already; --force replaces it")


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """A path to write to, which becomes `path` when the block ends well."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        yield Path(folder) / path.name
        (Path(folder) / path.name).replace(path)


@contextmanager
def new_folder(target: Path) -> Iterator[Path]:
    """A folder to write to, whose files go to `target` when the block ends well."""
    target.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}."))
    try:
        yield folder
        for source in sorted(path for path in folder.rglob("*") if path.is_file()):
            place = target / source.relative_to(folder)
            place.parent.mkdir(parents=True, exist_ok=True)
            source.replace(place)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
