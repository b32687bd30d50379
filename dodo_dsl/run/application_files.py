"""Files beside a compiled test: those that the application reads, its secrets, and what it never sees."""

import contextlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from dodo_dsl.application.access.host_paths import HostPaths, repository
from dodo_dsl.application.access.model import AccessFinding
from dodo_dsl.application.access.secret_variables import is_steering
from dodo_dsl.application.interpolation import dotenv_file, interpolate, own_dotenv
from dodo_dsl.outcome import NEXT_REPORT
from dodo_dsl.plan.model import Application
from dodo_dsl.plan.test_files import SHARED
from dodo_dsl.state_folder import NoStateFolder, state_path
from dodo_dsl.template_cache import cache_home


def application_paths(application: Application, folder: Path) -> HostPaths:
    """Its repository and what the deployment allows; ``folder`` is the compiled test's."""
    own = (folder / application.folder).resolve()
    roots = (*repository(own), *((folder / root).resolve() for root in application.access.roots))
    return HostPaths(own, roots, tuple(map(Path, application.access.paths)), literal=True)


def secrets_of(application: Application, folder: Path, outside: Mapping[str, str]) -> dict[str, str]:
    """The secrets of its ``.env`` files that are there, with the variables ``outside`` filled in."""
    files = {path: dotenv_file(folder / path, outside) for path in set(application.secrets.values())}
    given = {name: path for name, path in application.secrets.items() if not is_steering(name)}
    return {name: files[path][name] for name, path in given.items() if name in files[path]}


def env_file_findings(application: Application, paths: HostPaths, known: Mapping[str, str]) -> Iterator[AccessFinding]:
    """Files of ``env_file`` that are not the application's; raises EnvironmentProblem for a variable without value."""
    variables = {**application.variables, **own_dotenv(paths.folder, known), **known}
    for service in application.services:
        for item, path in enumerate(service.env_files):
            if problem := paths.file_problem(interpolate(path, variables)):
                yield AccessFinding(("services", service.name, "env_file", item), problem)


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
