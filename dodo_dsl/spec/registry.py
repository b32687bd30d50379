"""Finding specs, and what a test may be called: registries are folders, a test is ``<name>/<name>.dodo.yml``."""

import glob
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.diagnostics import closest, shown_path
from dodo_dsl.source import resolve

SUFFIX = ".dodo.yml"
MAX_FOLDERS = 10_000


class RegistryError(Exception):
    """A folder is too large for a registry, or a file is named as DoDo does not read it; one sentence."""

    usage = True


def refuse_yaml(path: Path) -> None:
    """Raises RegistryError for a file that is called ``.yaml`` where DoDo reads ``.yml``, if it is there."""
    if path.is_file():
        raise RegistryError(f"'{shown_path(str(path))}' is not read: call it '{path.with_suffix('.yml').name}'")


@dataclass(frozen=True, order=True)
class Location:
    """A spec's file and the registry's root, which its paths may not leave."""

    path: Path
    root: Path

    @property
    def stem(self) -> str:
        return self.path.name.removesuffix(SUFFIX)


def _specs_below(folder: Path) -> Iterator[Path]:
    """The specs of a folder without hidden folders; raises RegistryError."""
    found = []
    for number, (place, folders, files) in enumerate(os.walk(folder), 1):
        if number > MAX_FOLDERS:
            raise RegistryError(f"'{folder}' has more than {MAX_FOLDERS} folders: name the folder with the tests")
        folders[:] = [name for name in folders if not name.startswith(".")]
        names = [name for name in files if not name.startswith(".")]
        for name in names:
            if name.endswith(".dodo.yaml"):
                refuse_yaml(Path(place, name))
        specs = (Path(place, name) for name in names if name.endswith(SUFFIX))
        found += [path for path in specs if path.is_file()]
    yield from sorted(found)


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

    ``others`` are further registries, which are only the roots of specs. Raises RegistryError.
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


KEYWORDS = frozenset(
    {
        "after-script",
        "before-script",
        "cache",
        "default",
        "false",
        "gate",
        "image",
        "include",
        "nil",
        "pages",
        "services",
        "spec",
        "stages",
        "true",
        "types",
        "variables",
        "workflow",
    }
)
"""Of GitLab's pipelines, which cannot name a job."""
_LONGEST = 60
_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


def is_name(text: str) -> bool:
    """Whether a test may be called so, but for keywords."""
    return len(text) <= _LONGEST and _NAME.fullmatch(text) is not None


def is_free(text: str) -> bool:
    """Whether a test may be called so, and YAML takes it for a text."""
    return is_name(text) and text not in KEYWORDS and resolve(text) == text


def near_path(text: str, folder: Path, root: Path, fits: Callable[[Path], bool] = Path.exists) -> str:
    """A hint about a path from a folder that leads nowhere: where DoDo looked, and a path like it that ``fits``.

    That is within ``root``: of a like name beside it, the test of its name, or the same from a folder above.
    """
    target = (folder / text).resolve()
    beside = [path.name for path in target.parent.iterdir()] if target.parent.is_dir() else []
    found = [target.parent / name for name in closest(target.name, beside)]
    for name in (target.name, f"{target.name}{SUFFIX}"):
        found += sorted(folder.parent.glob(f"*/{glob.escape(name)}"))
    hint = f"DoDo looked in {shown_path(str(target.parent))}"
    for path in (each.resolve() for each in (*found, folder / ".." / text, folder / "../.." / text)):
        if fits(path) and path.is_relative_to(root.resolve()):
            near = Path(os.path.relpath(path, folder)).as_posix()
            return f"{hint}; did you mean '{near}'?"
    return hint
