"""The client of a Docker engine: how to reach one, and what it says in its own words."""

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
        raise BackendError(f"no Docker engine answers ({error}); start one, or use --backend process") from error
    return client


def said(error: Exception) -> str:
    """The engine's own words, without those of the client around them; else the system's."""
    return str(getattr(error, "explanation", None) or getattr(error, "strerror", None) or error)
