"""The end of compose projects on an engine: stopped, reports copied, removed; also those that killed runs left."""

import contextlib
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from docker.errors import APIError, DockerException, NotFound

from dodo_dsl.application import secret_variables
from dodo_dsl.emit.compose import REPORT
from dodo_dsl.run import leases
from dodo_dsl.run.docker.client import engine_error

PROJECT_LABEL = "com.docker.compose.project"
SERVICE_LABEL = "com.docker.compose.service"
_STOP_S = 2
_RESTS_S = 0.5, 1.0, 2.0
"""Waits before removing once more what the engine refuses to: it may still be busy with a container that has ended."""


@dataclass
class Reaped:
    """A phrase for each thing that killed runs left: those that were removed, and those that could not be."""

    removed: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)


def _filters(project: str) -> dict[str, str]:
    return {"label": f"{PROJECT_LABEL}={project}"}


def stop_project(client: Any, project: str) -> None:
    """SIGTERM to all containers at once, SIGKILL to those that do not end within 2 s."""
    containers = client.containers.list(filters=_filters(project))
    with (
        ThreadPoolExecutor(max_workers=max(1, len(containers))) as pool,
        contextlib.suppress(DockerException, OSError),
    ):
        list(pool.map(lambda c: c.stop(timeout=_STOP_S), containers))


def remove_project(client: Any, project: str, rests_s: Sequence[float] = _RESTS_S) -> int:
    """Removes containers, networks and volumes of a project and returns their number, without those already removed.

    Goes on when one cannot be removed, tries it again after each of ``rests_s``, and raises the first such error at the
    end; raises OSError at once.
    """
    removed, problem = 0, None
    for rest_s in (0.0, *rests_s):
        time.sleep(rest_s)
        problem = None
        for remove in _removals(client, project):
            try:
                remove()
                removed += 1
            except NotFound:
                continue
            except APIError as error:
                problem = problem or error
        if problem is None:
            return removed
    assert problem is not None
    raise problem


def _removals(client: Any, project: str) -> Iterator[Callable[[], None]]:
    """Containers come first: networks and volumes can only be removed when no container uses them."""
    for container in client.containers.list(all=True, filters=_filters(project)):
        yield partial(container.remove, force=True, v=True)
    for network in client.networks.list(filters=_filters(project)):
        yield partial(_remove_network, network)
    yield from (volume.remove for volume in client.volumes.list(filters=_filters(project)))


def _remove_network(network: Any) -> None:
    """Removes a network, also where an endpoint is left of a container that is gone, or never started."""
    network.reload()
    for key, about in (network.attrs.get("Containers") or {}).items():
        if key.startswith("ep-"):
            network.disconnect(about["Name"], force=True)
    network.remove()


def reap_projects(client: Any) -> Reaped:
    """Removes the projects of killed runs, whose lease nobody holds; what cannot be removed keeps its record."""
    reaped = Reaped()
    for lease in leases.orphans(leases.PROJECT):
        project, test = lease.name.removeprefix(leases.PROJECT), lease.left.get("test", "?")
        try:
            count = remove_project(client, project, rests_s=())
        except (DockerException, OSError) as error:
            reaped.left.append(f"{test}: project {project}: {engine_error(error)}")
            lease.leave()
            continue
        if count:
            reaped.removed.append(f"{test}: {count} containers, networks and volumes")
        lease.release()
    return reaped


def take_down(client: Any, project: str, writers: Mapping[str, Any], report: Path, note: Callable[[str], None]) -> bool:
    """Whether everything was removed; ``writers`` are the containers with parts of the report."""
    try:
        stop_project(client, project)
        for name, container in writers.items():
            _copy_report(container.id, name, report, note)
        remove_project(client, project)
    except Exception as error:  # noqa: BLE001  (whatever it was, the record of the project has to stay)
        reason = engine_error(error)
        note(f"the engine cannot remove the test's containers ({reason}): the next run or 'dodo doctor --clean' does")
        return False
    return True


def _copy_report(container: str, name: str, folder: Path, note: Callable[[str], None]) -> None:
    """Copies the regular files of a container's report, all of them or none."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".copy-", dir=folder) as copy:
            words = ["docker", "cp", f"{container}:{REPORT}/.", copy]
            own = secret_variables.of_client(os.environ)
            subprocess.run(words, env=own, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True)
            for path in Path(copy).iterdir():
                if path.is_file() and not path.is_symlink():
                    path.replace(folder / path.name)
    except subprocess.CalledProcessError as error:
        note(f"the report misses files of {name}: {error.stderr.strip()}")
    except OSError as error:
        note(f"the report misses files of {name}: {error.strerror}")
