"""The end of compose projects on an engine: stopped, reports copied, removed; also those that killed runs left."""

import contextlib
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
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
"""From SIGTERM to SIGKILL."""
_RESTS_S = 0.5, 1.0, 2.0
"""Waits before removing once more what the engine refuses to: it may still be busy with a container that has ended."""


def _filters(project: str) -> dict[str, str]:
    return {"label": f"{PROJECT_LABEL}={project}"}


def remove_project(client: Any, project: str, rests_s: Sequence[float] = _RESTS_S) -> int:
    """Removes containers, networks and volumes of a project and returns their number, without those already removed.

    Goes on when one cannot be removed, tries it again after each of ``rests_s``, and raises the first such error at the
    end; raises OSError at once.
    """
    removed, filters, problem = 0, _filters(project), None
    for rest_s in (0.0, *rests_s):
        time.sleep(rest_s)
        removals = [partial(c.remove, force=True, v=True) for c in client.containers.list(all=True, filters=filters)]
        removals += [partial(_remove_network, network) for network in client.networks.list(filters=filters)]
        removals += [volume.remove for volume in client.volumes.list(filters=filters)]
        problem = None
        for remove in removals:
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


def _remove_network(network: Any) -> None:
    """Removes a network, also where an endpoint is left of a container that is gone, or never started."""
    network.reload()
    for key, about in (network.attrs.get("Containers") or {}).items():
        if key.startswith("ep-"):
            network.disconnect(about["Name"], force=True)
    network.remove()


def reap_projects(client: Any) -> tuple[list[str], list[str]]:
    """A phrase for each project of a killed run, whose lease nobody holds: removed, or not, and then on record."""
    removed, kept = [], []
    for lease in leases.orphans(leases.PROJECT):
        project, test = lease.name.removeprefix(leases.PROJECT), lease.left.get("test", "?")
        try:
            count = remove_project(client, project, rests_s=())
        except (DockerException, OSError) as error:
            kept.append(f"{test}: project {project}: {engine_error(error)}")
            lease.leave()
            continue
        if count:
            removed.append(f"{test}: {count} containers, networks and volumes")
        lease.release()
    return removed, kept


def take_down(client: Any, project: str, writers: Mapping[str, Any], report: Path, note: Callable[[str], None]) -> bool:
    """Whether everything was removed; ``writers`` are the containers with parts of the report."""
    try:
        running = client.containers.list(filters=_filters(project))
        with ThreadPoolExecutor(max(1, len(running))) as pool, contextlib.suppress(DockerException, OSError):
            list(pool.map(lambda container: container.stop(timeout=_STOP_S), running))
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
