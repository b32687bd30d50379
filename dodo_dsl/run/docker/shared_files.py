"""Whether the engine sees the files of this machine: it does not where it runs elsewhere, as in Docker-in-Docker."""

import io
import os
import tarfile
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dodo_dsl.run.docker.cleanup import PROJECT_LABEL
from dodo_dsl.run.docker.client import engine_error
from dodo_dsl.run.protocol import BackendError

IMAGE = "dodo-empty:1"
"""Made on the engine where it is missing; it has no files."""


def provide_image(client: Any) -> None:
    """Makes the empty image, unless the engine has it; raises BackendError."""
    from docker.errors import DockerException, ImageNotFound

    try:
        try:
            client.api.inspect_image(IMAGE)
        except ImageNotFound:
            empty = io.BytesIO()
            tarfile.open(fileobj=empty, mode="w").close()
            repository, tag = IMAGE.split(":")
            client.api.import_image_from_data(empty.getvalue(), repository=repository, tag=tag)
    except (DockerException, OSError) as error:
        raise BackendError(f"the Docker engine cannot make an empty image: {engine_error(error)}") from error


def unseen(client: Any, paths: Sequence[Path], project: str = "") -> Path | None:
    """The first of ``paths`` that the engine's machine has not; None if it has all, or does not show it.

    The engine says so when it makes a container, which belongs to ``project`` and never starts.
    """
    from docker.errors import APIError, DockerException
    from docker.types import Mount

    mounts = [Mount(f"/{number}", str(path), "bind", read_only=True) for number, path in enumerate(paths)]
    labels = {PROJECT_LABEL: project} if project else {}
    try:
        made = client.api.create_container(
            IMAGE, ["true"], labels=labels, host_config=client.api.create_host_config(mounts=mounts)
        )
        client.api.remove_container(made["Id"], force=True)
    except APIError as error:
        said = engine_error(error)
        named = [path for path in paths if said.rstrip().endswith(str(path)) or f"{path}:" in said]
        return max(named, key=lambda path: len(str(path)), default=None)
    except (DockerException, OSError):
        return None
    return None


def problem(path: Path) -> tuple[str, str]:
    """What is wrong with a path that the engine has not, and what to do."""
    where = f" at {host}" if (host := os.environ.get("DOCKER_HOST")) else ""
    shared = "in Docker-in-Docker on GitLab, it has what is below /builds"
    temporary = Path(tempfile.gettempdir()).resolve()
    way = "set TMPDIR to a folder that it has" if path.is_relative_to(temporary) else "work in a folder that it has"
    return f"the Docker engine{where} does not see '{path}' of this machine", f"{way}, at the same path; {shared}"
