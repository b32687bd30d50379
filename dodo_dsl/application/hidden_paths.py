"""What no application sees of its repository: tests, what they read, their output, services of DoDo and ``.git``.

A registry may hold the application's folder: then files are named one by one.
"""

import os
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.deployment import Deployment

MOST = 1_000
"""Files that are named one by one: bubblewrap takes 9,000 words, some four for each."""
_MADE = (".git", "generated", "dodo-report")


def problems(
    application: ApplicationSource, deployment: Deployment, registries: Collection[Path]
) -> Iterator[Diagnostic]:
    """Mounts, configs, secrets, files of variables and builds' contexts in a folder that no application sees."""
    hidden = unseen(application, deployment, registries)
    for source, span, _ in application.shown:
        if application.paths.is_writable(source):
            continue
        names = map(Path, application.paths.names(source))
        if holder := next((h for name in names for h in hidden if name.is_relative_to(h)), None):
            message = f"'{source}' lies in '{holder.name}', which no application sees"
            yield Diagnostic(span, "application-isolation", message, "keep what it needs in another folder")


def unseen(application: ApplicationSource, deployment: Deployment, registries: Collection[Path] = ()) -> list[Path]:
    """Folders with tests and own services, ``.git``, compiled tests and reports by default.

    One that is the application's own folder, or above it, is none of them.
    """
    own = application.folder.resolve()
    roots = {root.resolve() for root in (*application.paths.roots, deployment.root, own)}
    found = {path for path in _places(deployment, registries) if not own.is_relative_to(path)}
    return sorted(found | {root / name for root in roots for name in _MADE})


def folders(application: ApplicationSource, deployment: Deployment, registries: Collection[Path]) -> tuple[str, ...]:
    """The same of registries and services alone, relative to the application's folder."""
    own = application.folder.resolve()
    return _relative(application, (p for p in _written(deployment, registries) if not own.is_relative_to(p)))


def files(
    application: ApplicationSource, deployment: Deployment, registries: Collection[Path], named: Iterable[Path]
) -> tuple[str, ...]:
    """Those of the specs and of what they name that lie in registries which hold the application's folder."""
    own = application.folder.resolve()
    places = _written(deployment, registries)
    around = {place for place in places if own.is_relative_to(place)}
    inside = (p for p in named if around.intersection(p.parents) and not (places - around).intersection(p.parents))
    return _relative(application, inside) if around else ()


def _places(deployment: Deployment, registries: Collection[Path]) -> set[Path]:
    return {path.resolve() for path in {*registries, *deployment.registry, *deployment.services}}


def _written(deployment: Deployment, registries: Collection[Path]) -> set[Path]:
    """Without the shipped registry, which is in another place on each machine."""
    return _places(deployment, registries) - {package_data.registry().resolve()}


def _relative(application: ApplicationSource, paths: Iterable[Path]) -> tuple[str, ...]:
    """The paths in the application's repository, without what lies in another one of them."""
    own, roots = application.folder.resolve(), [root.resolve() for root in application.paths.roots]
    inside = {path for path in paths if any(map(path.is_relative_to, roots)) and not own.is_relative_to(path)}
    outermost = (path for path in inside if inside.isdisjoint(path.parents))
    return tuple(sorted(Path(os.path.relpath(path, own)).as_posix() for path in outermost))
