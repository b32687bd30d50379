"""What of the repository an application mounts: folders that are not there, or too large to be copied."""

import functools
import os
import stat
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

from dodo_dsl.application.access.access_diagnostics import place
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.application.nested_mounts import Shown, shown_paths
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

WAY_OUT = "mount it read-only (:ro), name it under 'paths' in dodo.yml, or raise '{key}' in 'sandbox' there"
_MB = 10**6


def missing_folders(application: ApplicationSource) -> Iterator[Diagnostic]:
    """Mounts of what is not there, and that the engine is told not to make; others are empty folders of the test."""
    for shown in _of_repository(application):
        if shown.is_required and not os.path.lexists(application.paths.whole(shown.source)):
            message = f"there is no file or folder '{shown.source}', and 'create_host_path: false' requires it"
            yield _problem(shown, message, "create it, or remove 'create_host_path'; paths are relative to this file")


def large_folders(application: ApplicationSource, hidden: Collection[Path]) -> Iterator[Diagnostic]:
    """The folder with which a test's copies are beyond their limits; of the ``hidden`` ones there are none."""
    limits, files, size = application.limits, 0, 0
    unseen = frozenset(str(path) for path in (*hidden, *(root / ".git" for root in application.paths.roots)))
    for folder, shown in _copied(application).items():
        own_files, own_size = measured(folder, unseen, limits.copied_files, Path(folder).stat().st_mtime_ns)
        files, size = files + own_files, size + own_size
        if problem := too_much(shown.source, (own_files, files), (own_size, size), limits):
            yield replace(_problem(shown, *problem), severity="warning")
            return


def too_much(
    source: str, files: tuple[int, int], size: tuple[int, int], limits: SandboxLimits
) -> tuple[str, str] | None:
    """Why a folder is not copied, and what to do; of ``files`` and bytes, its own and with those copied before."""
    if files[1] > limits.copied_files:
        own = f"more than {limits.copied_files}" if files[0] > limits.copied_files else str(files[0])
        message = f"'{source}' holds {own} files, and the copies of a test may hold {limits.copied_files}"
        return message, WAY_OUT.format(key="copied-files")
    if size[1] > limits.copies:
        message = f"'{source}' holds {size[0] // _MB} MB, and the copies of a test may hold {limits.copies // _MB} MB"
        return message, WAY_OUT.format(key="copies")
    return None


def _problem(shown: Shown, message: str, hint: str) -> Diagnostic:
    return Diagnostic(place(shown.node, shown.steps, shown.span), "application-file", message, hint)


def _of_repository(application: ApplicationSource) -> Iterator[Shown]:
    """The mounts of services that show a path of the repository."""
    paths = application.paths
    for shown in shown_paths(application):
        is_mount = shown.steps[0] == "volumes" and not paths.is_open(shown.source)
        if is_mount and paths.is_own(shown.source) and paths.is_of_repository(shown.source):
            yield shown


def _copied(application: ApplicationSource) -> dict[str, Shown]:
    """The mounts that tests copy, by the real path of their folder."""
    paths: HostPaths = application.paths
    found: dict[str, Shown] = {}
    for shown in _of_repository(application):
        folder = paths.names(shown.source)[-1]
        if shown.writer and not paths.is_writable(shown.source) and Path(folder).is_dir():
            found.setdefault(folder, shown)
    return found


@functools.lru_cache(maxsize=64)
def measured(folder: str, hidden: frozenset[str], most_files: int, _changed_ns: int) -> tuple[int, int]:
    """Files and folders below one, and their sizes in bytes; no more of them are counted than one beyond the most."""
    files, size, left = 0, 0, [folder]
    while left and files <= most_files:
        try:
            with os.scandir(left.pop()) as entries:
                for entry in entries:
                    about = entry.stat(follow_symlinks=False)
                    files, size = files + 1, size + about.st_size
                    if stat.S_ISDIR(about.st_mode) and entry.path not in hidden:
                        left.append(entry.path)
        except OSError:
            continue
    return files, size
