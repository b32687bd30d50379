"""The files that a test needs, which are copied beside its compiled form."""

import functools
from collections.abc import Mapping
from pathlib import Path

from dodo_dsl.spec.manifest import Parameter

MAX_FILES = 5_000
MAX_BYTES = 2 << 30


def needed(parameter: Parameter, path: Path, root: Path) -> Mapping[str, Path] | str:
    """The files that a parameter's path needs."""
    is_map = parameter.format == "map" and path.suffix == ".json"  # its meshes stand beside it
    return files(path.parent if is_map else path, root)


@functools.lru_cache(maxsize=256)
def files(path: Path, root: Path) -> Mapping[str, Path] | str:
    """The real paths of the file, or of all in the folder but hidden ones, by where they lie below ``root``.

    Or what is wrong with them.
    """
    root = root.resolve()
    found: dict[str, Path] = {}
    size = 0
    for file in (path,) if path.is_file() else sorted(path.rglob("*")):
        if not file.is_file() or any(p.startswith(".") or p == "__pycache__" for p in file.relative_to(path).parts):
            continue
        found[file.relative_to(root).as_posix()] = real = file.resolve()
        if not real.is_relative_to(root):
            return f"'{file.relative_to(root)}' is a symbolic link that leaves the registry"
        size += real.stat().st_size
        if len(found) > MAX_FILES or size > MAX_BYTES:
            return f"'{path.relative_to(root)}' holds more than {MAX_FILES} files or {MAX_BYTES >> 30} GiB"
    return found
