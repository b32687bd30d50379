"""Files of tests that lie among an application's own, known by what they are, as their users choose the names.

These are specs and what they name, maps, recordings, compiled tests and reports.
"""

import os
import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.emit.output_folder import PLAN_FILE
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import NEXT_REPORT

MOST_FOLDERS = 20_000
"""That are looked into; a registry is not searched any further either."""
_SPEC, _RECORDING, _MAP, _RESULTS = ".dodo.yml", ".rec", "map.json", "results.json"
_MARKS: Mapping[str, bytes] = {_RESULTS: b'"dodo": "results"', PLAN_FILE: b'"dodo": "plan"', _MAP: b'"model"'}
"""What DoDo's files of these names hold in their first bytes; an application may have others."""
_ENVIRONMENT = "pyvenv.cfg"
_HEAD = 4096
_DATA = {".json", ".rec", ".obj", ".mtl", ".png", ".jpg", ".jpeg", ".mp4", ".yml", ".yaml", ".md"}
_WORD = re.compile(r"""[^\s'"\[\]{},:#]+""")


def files_of_tests(folder: Path, own: Path, known: Collection[Path] = ()) -> list[Path]:
    """Files and folders of tests below a folder, by their real paths, but for those in ``known`` folders.

    None is ``own`` or holds it, which is the application's folder: what a test has there itself is named one by one.
    """
    found: list[Path] = []
    left, seen, passed = [folder], 0, frozenset(known)
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
        found += [place / name for name in files if name.endswith((_SPEC, _RECORDING)) or _is_marked(place, name)]
        if _is_report(place, files):
            left += [place / name for name in folders if not _is_test_of_report(place / name)]
            found += [place / name for name in folders if _is_test_of_report(place / name)]
        else:
            left += [place / name for name in folders if name != ".git"]
    return list(dict.fromkeys(found))


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
    """Whether a folder is a report, a compiled test, a map, or holds specs or recordings and nothing but data."""
    if place.name.startswith(NEXT_REPORT) or any(_is_marked(place, name) for name in files):
        return True
    is_data = not folders and all(Path(name).suffix.lower() in _DATA for name in files)
    return is_data and any(name.endswith((_SPEC, _RECORDING)) for name in files)


def _is_marked(place: Path, name: str) -> bool:
    return name in _MARKS and _MARKS[name] in _head(place / name)


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
        for word in _WORD.findall(line):
            path = _data(spec.parent / word)
            if path and path.is_relative_to(folder) and not own.is_relative_to(path):
                yield path


def _data(path: Path) -> Path | None:
    """The real path of a file of data, or of a folder with a map; None for what can be no path, as with a NUL."""
    try:
        real = Path(os.path.realpath(path))
        is_data = (real.suffix.lower() in _DATA - {".md"} and real.is_file()) or (real / _MAP).is_file()
    except (OSError, ValueError):
        return None
    return real if is_data else None
