"""The client of a Docker engine, and the texts of the engine's errors."""

import os
from typing import Any

from dodo_dsl.run.protocol import BackendError

_CONNECTIONS = 200


def connect() -> Any:
    """A client of the engine; raises BackendError with what to do when none answers."""
    import docker
    from docker.errors import DockerException

    try:
        client = docker.from_env(max_pool_size=_CONNECTIONS)
        client.ping()
    except (DockerException, OSError) as error:
        if _is_refused(error):
            socket = os.environ.get("DOCKER_HOST", "/var/run/docker.sock")
            advice = "join the group that owns it, or use --backend process"
            raise BackendError(f"this user may not use the Docker engine at {socket}: {advice}") from error
        raise BackendError(f"no Docker engine answers ({error}); start one, or use --backend process") from error
    return client


def _is_refused(error: object) -> bool:
    """Whether an engine is there and refuses this user; the client wraps the system's error in others."""
    inner = (*error.args, error.__cause__, error.__context__) if isinstance(error, BaseException) else ()
    return isinstance(error, PermissionError) or any(map(_is_refused, inner))


def engine_error(error: Exception) -> str:
    """The engine's explanation of an error without the client's text around it, or the system's."""
    return str(getattr(error, "explanation", None) or getattr(error, "strerror", None) or error)
