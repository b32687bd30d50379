"""The client of a Docker engine, and the texts of the engine's errors."""

from typing import Any

from dodo_dsl import advice
from dodo_dsl.run.protocol import BackendError

_CONNECTIONS = 200


class NoEngine(BackendError):
    """No engine answers, for a ``reason``; the text also says what to do."""

    def __init__(self, reason: str) -> None:
        self.way = advice.engine()
        super().__init__(f"no Docker engine answers ({reason}): {self.way}")
        self.reason = reason


def connect() -> Any:
    """A client of the engine; raises NoEngine when none answers."""
    import docker
    from docker.errors import DockerException

    try:
        client = docker.from_env(max_pool_size=_CONNECTIONS)
        client.ping()
    except (DockerException, OSError) as error:
        raise NoEngine(_reason(error)) from error
    return client


def _reason(error: Exception) -> str:
    """What the system says of the engine's socket, without the layers of libraries around it."""
    below: BaseException | None = error
    while below is not None:
        if isinstance(below, OSError) and below.strerror:
            return below.strerror
        below = below.__cause__ or below.__context__
    return str(error)


def engine_error(error: Exception) -> str:
    """The engine's explanation of an error without the client's text around it, or the system's."""
    return str(getattr(error, "explanation", None) or getattr(error, "strerror", None) or error)
