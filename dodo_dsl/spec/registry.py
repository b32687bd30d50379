"""Finding specs: registries are folders, a test is ``<name>/<name>.dodo.yml``."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

SUFFIX = ".dodo.yml"


@dataclass(frozen=True, order=True)
class Location:
    """A spec's file and the registry's root, which its paths may not leave."""

    path: Path
    root: Path

    @property
    def stem(self) -> str:
        return self.path.name.removesuffix(SUFFIX)


def _specs_below(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.rglob(f"*{SUFFIX}")):
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(folder).parts):
            yield path


def _root_of(path: Path, registries: Sequence[Path]) -> Path:
    """The registry that holds a spec; for a spec outside all, the parent of its own folder."""
    for registry in registries:
        if path.is_relative_to(registry):
            return registry
    own_folder = path.parent.name == path.name.removesuffix(SUFFIX)
    return path.parent.parent if own_folder else path.parent


def _root_below(path: Path, folder: Path, registries: Sequence[Path]) -> Path:
    """The root of a spec found below a folder: the folder itself where it is above the spec's own root."""
    root = _root_of(path, registries)
    return folder if root.is_relative_to(folder) and root not in registries else root


def locate(
    paths: Iterable[Path], registries: Sequence[Path], others: Sequence[Path] = ()
) -> tuple[list[Location], list[Path]]:
    """The specs at or below ``paths`` (all ``registries`` without any), and the paths without specs.

    ``others`` are further registries, which are only the roots of specs.
    """
    own = [r.resolve() for r in registries]
    roots = [*own, *(r.resolve() for r in others)]
    found: dict[Path, Location] = {}
    empty = []
    wanted = [p.resolve() for p in paths] or own
    for path in wanted:
        if path.is_dir():
            specs = [Location(p, _root_below(p, path, roots)) for p in _specs_below(path)]
        else:
            specs = [Location(path, _root_of(path, roots))] if path.is_file() and path.name.endswith(SUFFIX) else []
        found.update((s.path, s) for s in specs)
        if not specs and path not in roots:
            empty.append(path)
    return sorted(found.values(), key=lambda s: (s.stem, s.path)), empty
