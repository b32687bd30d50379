"""What no test's application sees of its repository: tests, what they read, and services of DoDo.

Paths are relative to the application's folder. A registry may hold that folder: then files are named one by one.
"""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.plan.test_files import FilesError
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.model import Spec

MOST = 1_000
"""Files that are named one by one: bubblewrap takes 9,000 words, some four for each."""


def folders(application: ApplicationSource, deployment: Deployment, specs: Sequence[Spec]) -> tuple[str, ...]:
    """Registries of the tests and of the deployment, and folders of services."""
    own = application.folder.resolve()
    return _relative(application, (place for place in _places(deployment, specs) if not own.is_relative_to(place)))


def files(
    application: ApplicationSource, deployment: Deployment, specs: Sequence[Spec], named: Iterable[Path]
) -> tuple[str, ...]:
    """The specs, and what they name, in registries that hold the application's folder; raises FilesError."""
    own = application.folder.resolve()
    places = _places(deployment, specs)
    around = {place for place in places if own.is_relative_to(place)}
    if not around:
        return ()
    found = {*(spec.path for spec in specs), *named}
    inside = (
        path for path in found if around.intersection(path.parents) and not (places - around).intersection(path.parents)
    )
    relative = _relative(application, inside)
    if len(relative) > MOST:
        message = f"{len(relative):,} files of tests lie among the application's own, expected at most {MOST:,}"
        raise FilesError(f"{message}: keep tests in a folder of theirs ('registry' in dodo.yml)")
    return relative


def _places(deployment: Deployment, specs: Iterable[Spec]) -> set[Path]:
    """Without the shipped registry, which is in another place on each machine."""
    roots = {spec.location.root for spec in specs}
    found = {path.resolve() for path in {*roots, *deployment.registry, *deployment.services}}
    return found - {package_data.registry().resolve()}


def _relative(application: ApplicationSource, paths: Iterable[Path]) -> tuple[str, ...]:
    """The paths in the application's repository, without what lies in another one of them."""
    own, roots = application.folder.resolve(), [root.resolve() for root in application.paths.roots]
    inside = {path for path in paths if any(map(path.is_relative_to, roots)) and not own.is_relative_to(path)}
    outermost = (path for path in inside if inside.isdisjoint(path.parents))
    return tuple(sorted(Path(os.path.relpath(path, own)).as_posix() for path in outermost))
