"""What a compiled test names and does not hold: files that the application reads, and variables."""

import os
from pathlib import Path

from dodo_dsl.application import secret_variables
from dodo_dsl.application.host_paths import HostPaths, repository
from dodo_dsl.application.interpolation import dotenv_file
from dodo_dsl.plan.model import Application


def application_paths(application: Application, folder: Path) -> HostPaths:
    """Its repository and what the deployment allows; ``folder`` is the compiled test's."""
    own = (folder / application.folder).resolve()
    roots = (*repository(own), *((folder / root).resolve() for root in application.access.roots))
    return HostPaths(own, roots, tuple(map(Path, application.access.paths)))


def variables_of(application: Application, folder: Path) -> dict[str, str]:
    """What its compiled files name: what it may have of DoDo's environment, and the secrets of its ``.env`` files.

    Raises EnvironmentProblem.
    """
    outside = secret_variables.allowed(os.environ, application.access.passed)
    files = {path: dotenv_file(folder / path, outside) for path in set(application.secrets.values())}
    given = {name: path for name, path in application.secrets.items() if not secret_variables.is_steering(name)}
    return {**{name: files[path][name] for name, path in given.items() if name in files[path]}, **outside}
