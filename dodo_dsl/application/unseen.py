"""What no application sees: the repository's tests, their output and ``.git``."""

import os
from collections.abc import Collection, Iterator
from pathlib import Path

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.deployment import Deployment

_OUTPUT = ("generated", "dodo-report")


def unseen_folders(application: ApplicationSource, deployment: Deployment, others: Collection[Path] = ()) -> list[Path]:
    """What no application sees: folders with tests and own services, ``.git``, compiled tests and reports by default.

    A registry, or one of the ``others``, that is the application's own folder, or above it, is none of them.
    """
    own = application.folder.resolve()
    found = {Path(os.path.realpath(folder)) for folder in (*deployment.registry, *deployment.services, *others)}
    roots = {Path(os.path.realpath(root)) for root in (*application.paths.roots, deployment.root, own)}
    made = {root / name for root in roots for name in (".git", *_OUTPUT)}
    return sorted({path for path in found if not own.is_relative_to(path)} | made)


def unseen_problems(
    application: ApplicationSource, deployment: Deployment, registries: Collection[Path]
) -> Iterator[Diagnostic]:
    """Mounts, configs, secrets, files of variables and builds' contexts in a folder that no application sees."""
    hidden = unseen_folders(application, deployment, registries)
    for source, span, _ in application.shown:
        if application.paths.is_writable(source):
            continue
        names = map(Path, application.paths.names(source))
        if holder := next((h for name in names for h in hidden if name.is_relative_to(h)), None):
            message = f"'{source}' lies in '{holder.name}', which no application sees"
            yield Diagnostic(span, "application-isolation", message, "keep what it needs in another folder")
