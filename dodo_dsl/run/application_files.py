"""Files next to a compiled test: those that the application reads, and its secrets."""

from collections.abc import Mapping
from pathlib import Path

from dodo_dsl.application.host_paths import HostPaths, repository
from dodo_dsl.application.interpolation import dotenv_file
from dodo_dsl.application.secret_variables import is_steering
from dodo_dsl.plan.model import Application


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
