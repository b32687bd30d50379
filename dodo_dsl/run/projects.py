"""Compose projects on an engine, by label: stop, copy out of, remove, and find what killed runs left."""

import contextlib
import io
import tarfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from dodo_dsl.run import leases

PROJECT_LABEL = "com.docker.compose.project"
SERVICE_LABEL = "com.docker.compose.service"
_STOP_S = 2
_MAX_COPY = 4 << 30


def _filters(project: str) -> dict[str, str]:
    return {"label": f"{PROJECT_LABEL}={project}"}


def stop_project(client: Any, project: str) -> None:
    """SIGTERM to all containers at once, SIGKILL to those that do not end within 2 s."""
    from docker.errors import DockerException

    containers = client.containers.list(filters=_filters(project))
    with ThreadPoolExecutor(max_workers=max(1, len(containers))) as pool, contextlib.suppress(DockerException):
        list(pool.map(lambda c: c.stop(timeout=_STOP_S), containers))


def remove_project(client: Any, project: str) -> int:
    """Removes containers, networks and volumes of a project, and says how many; what is gone already is no error."""
    from docker.errors import NotFound

    removed = 0
    containers = client.containers.list(all=True, filters=_filters(project))
    for resource in containers:
        with contextlib.suppress(NotFound):
            resource.remove(force=True, v=True)
            removed += 1
    for resource in [*client.networks.list(filters=_filters(project)), *client.volumes.list(filters=_filters(project))]:
        with contextlib.suppress(NotFound):
            resource.remove()
            removed += 1
    return removed


def copy_out(container: Any, folder: str, target: Path) -> None:
    """The plain files of a container's folder; names that would leave ``target`` and links are passed over."""
    chunks, _ = container.get_archive(folder)
    with io.BytesIO() as archive:
        for chunk in chunks:
            archive.write(chunk)
            if archive.tell() > _MAX_COPY:
                return
        archive.seek(0)
        with tarfile.open(fileobj=archive) as tar:
            for member in tar:
                name = Path(member.name).name
                if member.isfile() and name not in ("", ".", "..") and (content := tar.extractfile(member)):
                    (target / name).write_bytes(content.read())


def reap_projects(client: Any) -> list[str]:
    """Removes the projects of killed runs: those whose lease nobody holds, and nothing else."""
    removed = []
    for lease, about in leases.orphans(leases.PROJECT):
        project = lease.name.removeprefix(leases.PROJECT)
        count = remove_project(client, project)
        if count:
            removed.append(f"{about.get('test', '?')}: {count} containers, networks and volumes")
        lease.release()
    return removed
