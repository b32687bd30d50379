"""Files next to a compiled test: those that the application reads, its secrets, and what it never sees.

Files of tests among an application's own are known by what they are, because users choose the names: specs and what
they name, maps, recordings, compiled tests and reports.
"""

import contextlib
import functools
import json
import os
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.application.host_paths import HostPaths, repository
from dodo_dsl.application.interpolation import dotenv_file
from dodo_dsl.application.secret_variables import is_steering
from dodo_dsl.emit.output_folder import PLAN_FILE
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import NEXT_REPORT
from dodo_dsl.plan.model import Application
from dodo_dsl.plan.test_files import SHARED
from dodo_dsl.state_folder import NoStateFolder, state_path
from dodo_dsl.template_cache import cache_home


def application_paths(application: Application, folder: Path) -> HostPaths:
    """Its repository and what the deployment allows; ``folder`` is the compiled test's."""
    own = (folder / application.folder).resolve()
    roots = (*repository(own), *((folder / root).resolve() for root in application.access.roots))
    return HostPaths(own, roots, tuple(map(Path, application.access.paths)))


def secrets_of(application: Application, folder: Path, outside: Mapping[str, str]) -> dict[str, str]:
    """The secrets of its ``.env`` files that are there, with the variables ``outside`` filled in."""
    files = {path: dotenv_file(folder / path, outside) for path in set(application.secrets.values())}
    given = {name: path for name, path in application.secrets.items() if not is_steering(name)}
    return {name: files[path][name] for name, path in given.items() if name in files[path]}


def hidden_paths(application: Application, folder: Path, report: Path) -> list[Path]:
    """Folders with tests, compiled tests, reports, history, DoDo's state and caches, as far as they are there.

    So are files that tests read, where the application's folder is one of tests.
    """
    paths = application_paths(application, folder)
    found = [paths.folder / path for path in application.hidden]
    found += [path for own in (folder.resolve(), report.resolve()) if (path := _holder(own, paths.folder))]
    found += [folder.resolve().parent / SHARED] if folder.resolve().parent == paths.folder else []
    found += [root / ".git" for root in paths.roots]
    found += [own for own in _own_folders() if any(own.is_relative_to(root) for root in paths.roots)]
    return [Path(os.path.realpath(path)) for path in found if path.exists()]


def _own_folders() -> Iterator[Path]:
    """Where DoDo keeps its state and its caches: jobs of a pipeline may keep them in the project's folder."""
    with contextlib.suppress(NoStateFolder):
        yield state_path("", "")
    with contextlib.suppress(KeyError):
        yield cache_home() / "dodo"


def _holder(path: Path, own: Path) -> Path | None:
    """What to hide of an output: the folder that holds it, if that is still below the application's.

    Of a report that is not in its place yet, that is the place of all.
    """
    path = path.parent if path.parent.name.startswith(NEXT_REPORT) else path
    return next((p for p in (path.parent, path) if p != own and p.is_relative_to(own)), None)


MOST_FOLDERS = 20_000
"""That are looked into; a registry is not searched any further either."""
_SPEC, _RECORDING, _MAP, _RESULTS = ".dodo.yml", ".rec", "map.json", "results.json"
_MARKS: Mapping[str, bytes] = {_RESULTS: b'"dodo": "results"', PLAN_FILE: b'"dodo": "plan"'}
"""What DoDo's output of these names holds in its first bytes; an application may have other files of these names."""
MOST_IN_FOLDER = 100
"""Files that are hidden one by one in a folder; beyond that, the whole folder is."""
MOST_HIDDEN = 1_000
"""Files and folders that a sandbox hides: bubblewrap takes 9,000 words, some four for each."""
MOST_BYTES = 1 << 16
"""Of their paths, which go to the sandbox in one message."""
_ENVIRONMENT = "pyvenv.cfg"
_HEAD = 4096
_OF_MAPS = {".json", ".obj", ".mtl", ".png", ".jpg", ".jpeg", ".md"}
_OF_RECORDINGS = {_RECORDING, ".mp4", ".md"}
_DATA = _OF_MAPS | _OF_RECORDINGS | {".csv", ".txt", ".yml", ".yaml"}
_PLACEHOLDERS = re.compile(r"(\$\{[^}]*\}|\*)+")
_WORD = re.compile(r"""[^\s'"\[\]{},:#]+""")


@dataclass(frozen=True)
class Found:
    """Files and folders of tests; ``problem`` says that there may be more of them, and is empty else."""

    paths: tuple[Path, ...]
    problem: str = ""


def files_of_tests(folder: Path, own: Path, known: Collection[Path] = ()) -> Found:
    """Files and folders of tests below a folder, by their real paths, but for those in ``known`` folders.

    None is ``own`` or holds it, which is the application's folder: what a test has there itself is named one by one.
    A folder is searched once, until ``forget``.
    """
    return _files_of_tests(folder, own, frozenset(known))


@functools.lru_cache(maxsize=64)
def _files_of_tests(folder: Path, own: Path, passed: frozenset[Path]) -> Found:
    found: list[Path] = []
    left, seen = [folder], 0
    while left and seen < MOST_FOLDERS:
        place, seen = left.pop(), seen + 1
        if place in passed:
            continue
        files, folders = _entries(place)
        if _ENVIRONMENT in files:  # thousands of files, of packages alone
            found += place.glob(package_data.INSTALLED)
            continue
        for spec in (place / name for name in files if name.endswith(_SPEC)):
            found += _named(spec, folder, own)
        if not own.is_relative_to(place) and _is_of_tests(place, files, folders):
            found.append(place)
            continue
        found += [place / name for name in files if name.endswith((_SPEC, _RECORDING)) or _is_ours(place, name)]
        if _is_report(place, files):
            left += [place / name for name in folders if not _is_test_of_report(place / name)]
            found += [place / name for name in folders if _is_test_of_report(place / name)]
        else:
            left += [place / name for name in folders if name != ".git"]
    what = f"'{folder}' holds more than {MOST_FOLDERS:,} folders: files of tests in the others are not hidden from the"
    problem = f"{what} application; keep tests in a folder of theirs (registry in dodo.yml)" if left else ""
    return Found(tuple(dict.fromkeys(found)), problem)


def forget() -> None:
    """Folders are searched again, as by another run."""
    _files_of_tests.cache_clear()


def in_few(paths: Sequence[Path], own: Path) -> list[Path]:
    """The paths with whole folders where many files are hidden, but for ``own``; raises ValueError for too many."""
    counts = Counter(path.parent for path in paths)
    full = {folder for folder, count in counts.items() if count > MOST_IN_FOLDER and not own.is_relative_to(folder)}
    found = [*(path for path in paths if not full.intersection(path.parents)), *sorted(full)]
    if len(found) > MOST_HIDDEN or sum(len(json.dumps(str(path))) for path in found) > MOST_BYTES:
        what = f"{len(found):,} files and folders of tests lie among the application's own in '{own}'"
        way_out = "keep them in a folder of theirs (registry in dodo.yml)"
        raise ValueError(
            f"{what}, and a sandbox hides at most {MOST_HIDDEN:,} with {MOST_BYTES:,} bytes of paths: {way_out}"
        )
    return found


def _entries(folder: Path) -> tuple[list[str], list[str]]:
    """The names of files and of folders, without symbolic links: these lead to files that are found where they are."""
    files, folders = [], []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    folders.append(entry.name)
                elif entry.is_file(follow_symlinks=False):
                    files.append(entry.name)
    except OSError:  # what DoDo cannot read
        return [], []
    return sorted(files), sorted(folders)


def _is_of_tests(place: Path, files: list[str], folders: list[str]) -> bool:
    """Whether a folder is a report or a compiled test, or holds a map, specs or recordings and nothing else."""
    if place.name.startswith(NEXT_REPORT) or any(_is_marked(place, name) for name in files):
        return True
    kinds = {Path(name).suffix.lower() for name in files}
    if folders or not kinds <= _DATA:
        return False
    if any(name.endswith(_SPEC) for name in files):
        return True
    return (_RECORDING in kinds <= _OF_RECORDINGS) or (kinds <= _OF_MAPS and _MAP in files and _is_map(place))


def _is_ours(place: Path, name: str) -> bool:
    return _is_marked(place, name) or (name == _MAP and _is_map(place))


def _is_marked(place: Path, name: str) -> bool:
    return name in _MARKS and _MARKS[name] in _head(place / name)


def _is_map(place: Path) -> bool:
    """Whether the folder's ``map.json`` has what OpenDLV's maps have."""
    try:
        raw = json.loads(regular_file.content(place / _MAP))
    except (OSError, ValueError, RecursionError):
        return False
    models = raw.get("model") if isinstance(raw, dict) else None
    return isinstance(models, list) and all(
        isinstance(model, dict) and not model.keys().isdisjoint(("instances", "frames")) for model in models
    )


def _is_report(place: Path, files: list[str]) -> bool:
    return _RESULTS in files and _is_marked(place, _RESULTS)


def _is_test_of_report(folder: Path) -> bool:
    return any((folder / name).exists() for name in ("test.rec", "drive.html", "drive.js"))


def _head(path: Path) -> bytes:
    try:
        with regular_file.opened(path) as file:
            return file.read(_HEAD)
    except OSError:
        return b""


def _named(spec: Path, folder: Path, own: Path) -> Iterator[Path]:
    """What a spec names of its tests' data; under ``application`` stands what the application is to have."""
    try:
        lines = regular_file.content(spec).decode(errors="replace").splitlines()
    except OSError:
        return
    section = ""
    for line in lines:
        if line[:1].strip():
            section = line.split(":", 1)[0]
        if section == "application":
            continue
        for path in map(_data, _paths(spec.parent, line)):
            if path and path.is_relative_to(folder) and not own.is_relative_to(path):
                yield path


def _paths(folder: Path, line: str) -> Iterator[Path]:
    """What the words of a line may name; a placeholder as ``${matrix.map}`` stands for whatever is there."""
    has_placeholders = "${" in line
    for word in _WORD.findall(_PLACEHOLDERS.sub("*", line) if has_placeholders else line):
        if not has_placeholders or "*" not in word:
            yield folder / word
        elif any(map(str.isalnum, word)) and "\0" not in word and not word.startswith("/"):
            yield from (path for path in folder.glob(word) if Path(word).suffix or path.is_dir())


def _data(path: Path) -> Path | None:
    """The real path of a file of data, or of a folder with a map; None if it cannot be a path, as with a NUL."""
    try:
        real = Path(os.path.realpath(path))
        is_data = (real.suffix.lower() in _DATA - {".md"} and real.is_file()) or (real / _MAP).is_file()
    except (OSError, ValueError):
        return None
    return real if is_data else None
