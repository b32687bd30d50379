"""The end of compose projects on an engine: stopped, reports copied, removed; also those that killed runs left.

Projects are known by their label. Files are copied out of a container from the stream that the engine sends, with one
chunk at a time in memory.
"""

import contextlib
import errno
import functools
import shutil
import tarfile
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl import atomic
from dodo_dsl.emit.compose import REPORT
from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.docker.client import engine_error

_CHUNK = 1 << 16


def copy_out(container: Any, folder: str, target: Path) -> None:
    """Copies the regular files of a container's folder by their last name; links are skipped.

    Each file is complete or absent. Raises OSError when the disk is full, or the stream is damaged.
    """
    chunks, _ = container.get_archive(folder, chunk_size=_CHUNK)
    stream: Any = _Stream(chunks)
    try:
        with tarfile.open(fileobj=stream, mode="r|") as tar:
            for member in tar:
                name = Path(member.name).name
                if member.isfile() and name not in ("", ".", "..") and (content := tar.extractfile(member)):
                    with atomic.replacing(target / name) as part, part.open("xb") as file:
                        shutil.copyfileobj(content, file)
        for _ in chunks:  # of padding: a stream that is read to its end gives its connection back
            pass
    except tarfile.TarError as error:
        raise OSError(errno.EIO, f"the archive from the engine is damaged ({error})") from error


class _Stream:
    """Chunks of bytes as a file that can be read once."""

    def __init__(self, chunks: Iterable[bytes]) -> None:
        self._chunks, self._rest = iter(chunks), b""

    def read(self, size: int) -> bytes:
        while len(self._rest) < size and (chunk := next(self._chunks, b"")):
            self._rest += chunk
        data, self._rest = self._rest[:size], self._rest[size:]
        return data


PROJECT_LABEL = "com.docker.compose.project"
SERVICE_LABEL = "com.docker.compose.service"
_STOP_S = 2
_WITHOUT_CONTAINER = "ep-"
"""How an engine lists an endpoint whose container is gone, or never started."""
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
    from docker.errors import DockerException

    containers = client.containers.list(filters=_filters(project))
    with (
        ThreadPoolExecutor(max_workers=max(1, len(containers))) as pool,
        contextlib.suppress(DockerException, OSError),
    ):
        list(pool.map(lambda c: c.stop(timeout=_STOP_S), containers))


def remove_project(client: Any, project: str, rests_s: Sequence[float] = _RESTS_S) -> int:
    """Removes containers, networks and volumes of a project and returns their number, without those already removed.

    Goes on when one cannot be removed, tries it again after each of ``rests_s``, and raises the first such error at the
    end.
    """
    from docker.errors import APIError, DockerException, NotFound

    removed, problem = 0, None
    for rest_s in (0.0, *rests_s):
        if problem is not None and not isinstance(problem, APIError):
            break
        time.sleep(rest_s)
        problem = None
        for remove in _removals(client, project):
            try:
                remove()
                removed += 1
            except NotFound:
                continue
            except (DockerException, OSError) as error:
                problem = problem or error
        if problem is None:
            return removed
    raise problem or OSError("nothing was tried")


def _removals(client: Any, project: str) -> Iterator[Callable[[], None]]:
    """Containers come first: networks and volumes can only be removed when no container uses them."""
    for container in client.containers.list(all=True, filters=_filters(project)):
        yield functools.partial(container.remove, force=True, v=True)
    for network in client.networks.list(filters=_filters(project)):
        yield functools.partial(_remove_network, network)
    yield from (volume.remove for volume in client.volumes.list(filters=_filters(project)))


def _remove_network(network: Any) -> None:
    """Removes a network, also where an endpoint is left of a container that could not start."""
    network.reload()
    for key, about in (network.attrs.get("Containers") or {}).items():
        if key.startswith(_WITHOUT_CONTAINER):
            network.disconnect(about["Name"], force=True)
    network.remove()


def reap_projects(client: Any) -> Reaped:
    """Removes the projects of killed runs, which are those whose lease nobody holds.

    A project that cannot be removed keeps its record for the next time.
    """
    from docker.errors import DockerException

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


def writers(plan: Plan) -> set[str]:
    """The services that write files of the report."""
    return {service.name for service in plan.services if any(flag.kind == "report" for flag in service.flags)}


def take_down(
    client: Any,
    project: str,
    containers: Mapping[str, Any],
    report: tuple[Collection[str], Path],
    note: Callable[[str], None],
) -> bool:
    """Whether everything was removed; ``report`` are the services that write it, and its folder.

    The next run removes what cannot be removed now, as when the engine has stopped.
    """
    try:
        stop_project(client, project)
        for name in report[0]:
            if name in containers:
                _copy_report(containers[name], name, report[1], note)
        remove_project(client, project)
    except Exception as error:  # noqa: BLE001  (whatever it was, the record of the project has to stay)
        reason = engine_error(error)
        note(f"the engine cannot remove the test's containers ({reason}): the next run or 'dodo doctor --clean' does")
        return False
    return True


def _copy_report(container: Any, name: str, folder: Path, note: Callable[[str], None]) -> None:
    from docker.errors import DockerException

    try:
        copy_out(container, f"{REPORT}/.", folder)
    except (DockerException, OSError) as error:
        note(f"the report misses files of {name}: {engine_error(error)}")
