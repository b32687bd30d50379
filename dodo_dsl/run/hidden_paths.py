"""What an application never sees: what its plan names, the test itself, reports, history, and what is DoDo's own."""

import contextlib
import functools
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.emit.render import CHILD
from dodo_dsl.outcome import NEXT_REPORT
from dodo_dsl.plan.model import Application
from dodo_dsl.plan.test_files import SHARED
from dodo_dsl.run.application_files import application_paths
from dodo_dsl.run.process.confinement import INTERPRETER
from dodo_dsl.state_folder import NoStateFolder, cache_home, state_path

_OUTPUT = ("dodo-report", f"generated/{CHILD}")
"""Where earlier runs wrote by default; an application may have another folder 'generated'."""
_OF_CHECKOUT = ("tests_registry", "tests", "templates", "benchmarks", "docs", "generated", "dodo-report", "build",
                "dist")  # fmt: skip
"""Folders of a checkout with tests, or with what was made of them."""


def hidden_paths(application: Application, folder: Path, report: Path) -> list[Path]:
    """Files and folders that are there, by their real paths; ``folder`` is the compiled test's."""
    paths = application_paths(application, folder)
    outputs = [path for one in (folder, report) for path in _output(one.resolve(), paths.folder, paths.roots)]
    named = (paths.folder / path for path in application.hidden)
    found = _real([*named, *outputs, *of_repository((*paths.roots, paths.folder))])
    return [path for path in found if not paths.folder.is_relative_to(path)]


def of_repository(roots: Sequence[Path]) -> list[Path]:
    """What is hidden of all folders: their history, earlier output in its default places, and what is DoDo's own."""
    found = [root / ".git" for root in roots]
    found += [root / name.split("/")[0] for root in roots for name in _OUTPUT if (root / name).exists()]
    found += [path for path in (*_state(), *own_data()) if any(root in path.parents for root in roots)]
    return _real(found)


def _real(paths: Iterable[Path]) -> list[Path]:
    return list(dict.fromkeys(Path(os.path.realpath(path)) for path in paths if path.exists()))


def _output(path: Path, own: Path, roots: Iterable[Path]) -> list[Path]:
    """What to hide of an output: the folder that holds it, if that is one of the repository and not around ``own``.

    Of a report that is not in its place yet, that is the place of all.
    """
    path = path.parent if path.parent.name.startswith(NEXT_REPORT) else path
    holder = path.parent
    is_whole = any(root in holder.parents for root in roots) and not own.is_relative_to(holder)
    return [holder] if is_whole else [path, holder / SHARED]


def _state() -> Iterator[Path]:
    """Where DoDo keeps its state and its caches: jobs of a pipeline may keep them in the project's folder."""
    with contextlib.suppress(NoStateFolder):
        yield state_path("", "")
    with contextlib.suppress(KeyError):
        yield cache_home() / "dodo"


@functools.cache
def own_data() -> tuple[Path, ...]:
    """Where DoDo's tests lie, however it is installed."""
    root = package_data.root()
    found = [data for prefix in map(Path, INTERPRETER) for data in prefix.glob(package_data.INSTALLED)]
    found += [Path(place, "dodo_dsl", "_data") for place in sys.path]
    if (root / "dodo_dsl").is_dir():
        found += [root, *(root / name for name in _OF_CHECKOUT), root / ".git"]
    there = (Path(os.path.realpath(path)) for path in (*found, root / "tests_registry") if path.is_dir())
    return tuple(dict.fromkeys(there))
