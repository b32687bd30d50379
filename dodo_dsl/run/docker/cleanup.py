"""The end of compose projects on an engine: stopped, reports copied, removed; also those that killed runs left.

Projects are known by their label. Files are copied out of a container from the stream that the engine sends, with one
chunk at a time in memory.
"""

import contextlib
import errno
import functools
import io
import shutil
import tarfile
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl import atomic
from dodo_dsl.emit.containers import REPORT
from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.docker.client import engine_error

MAX_BYTES = 4 << 30


def copy_out(container: Any, folder: str, target: Path, max_bytes: int = MAX_BYTES) -> None:
    """Copies the regular files of a container's folder by their last name; links are skipped.

    Each file is complete or absent. Raises OSError when the disk is full, or the stream is damaged or longer than
    ``max_bytes``.
    """
    chunks, _ = container.get_archive(folder)
    try:
        with tarfile.open(fileobj=_Stream(chunks, max_bytes), mode="r|") as tar:
            for member in tar:
                name = Path(member.name).name
                if member.isfile() and name not in ("", ".", "..") and (content := tar.extractfile(member)):
                    with atomic.replacing(target / name) as part, part.open("xb") as file:
                        shutil.copyfileobj(content, file)
        for _ in chunks:  # of padding: a stream that is read to its end gives its connection back
            pass
    except tarfile.TarError as error:
        raise OSError(errno.EIO, f"the archive from the engine is damaged ({error})") from error


class _Stream(io.RawIOBase):
    """Chunks of bytes as a file that can be read once; raises OSError beyond ``max_bytes`` bytes."""

    def __init__(self, chunks: Iterable[bytes], max_bytes: int) -> None:
        self._chunks = iter(chunks)
        self._max_bytes = max_bytes
        self._taken = 0
        self._rest = memoryview(b"")

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        if not self._rest:
            self._rest = memoryview(next((chunk for chunk in self._chunks if chunk), b""))
            self._taken += len(self._rest)
        if self._taken > self._max_bytes:
            raise OSError(errno.EFBIG, f"more than {self._max_bytes:,} bytes")
        count = min(len(buffer), len(self._rest))
        buffer[:count], self._rest = self._rest[:count], self._rest[count:]
        return count


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
    from docker.errors import APIError

    removed = 0
    for rest in (*rests_s, None):
        count, problems = _removed(client, project)
        removed += count
        if not problems:
            break
        if rest is None or not any(isinstance(problem, APIError) for problem in problems):
            raise problems[0]
        time.sleep(rest)
    return removed


def _removed(client: Any, project: str) -> tuple[int, list[Exception]]:
    """How many things were removed, and why others were not."""
    from docker.errors import DockerException, NotFound

    removed, problems = 0, list[Exception]()
    for remove in _removals(client, project):
        try:
            remove()
            removed += 1
        except NotFound:
            continue
        except (DockerException, OSError) as error:
            problems.append(error)
    return removed, problems


def _removals(client: Any, project: str) -> Iterator[Callable[[], None]]:
    """Containers come first: networks and volumes can only be removed when no container uses them."""
    for container in client.containers.list(all=True, filters=_filters(project)):
        yield functools.partial(container.remove, force=True, v=True)
    for network in client.networks.list(filters=_filters(project)):
        yield functools.partial(_remove_network, network)
    yield from (volume.remove for volume in client.volumes.list(filters=_filters(project)))


def _remove_network(network: Any) -> None:
    """Removes a network, also where an endpoint is left of a container that could not start."""
    from docker.errors import APIError, NotFound

    try:
        network.remove()
    except NotFound:
        raise
    except APIError:
        network.reload()
        endpoints = network.attrs.get("Containers") or {}
        left = [about["Name"] for key, about in endpoints.items() if key.startswith(_WITHOUT_CONTAINER)]
        for name in left:
            network.disconnect(name, force=True)
        if not left:
            raise
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
