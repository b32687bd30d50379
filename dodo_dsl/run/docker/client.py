"""The client of a Docker engine, the docker command, and the texts of the engine's errors."""

import asyncio
import contextlib
import tarfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import docker
from docker.constants import DEFAULT_DOCKER_API_VERSION
from docker.errors import DockerException, NotFound

from dodo_dsl import advice, atomic
from dodo_dsl.run import application_time
from dodo_dsl.run.protocol import BackendError

_CONNECTIONS = 200
_MOST_LINKS, _HEAD_SIZE = 10, 1 << 13
_IS_FOLDER, _CHANGES_USER = 1 << 31, 1 << 23 | 1 << 22
"""Modes as Go has them (fs.FileMode), in which the engine says them."""
_YIELDING = ("nice", "-n", "10")  # set-up must not slow down tests that already run


class NoEngine(BackendError):
    """No engine answers, for a ``reason``; the text also says what to do."""

    def __init__(self, reason: str) -> None:
        self.way = advice.engine()
        super().__init__(f"no Docker engine answers ({reason}): {self.way}")
        self.reason = reason


def connect() -> Any:
    """A client of the engine; raises NoEngine when none answers."""
    try:
        with contextlib.closing(_client(DEFAULT_DOCKER_API_VERSION)) as first:
            version = first.api.version(api_version=False)["ApiVersion"]
        client = _client(version)
        client.ping()
    except (DockerException, OSError) as error:
        raise NoEngine(_reason(error)) from error
    return client


def _client(version: str) -> Any:
    """A client that asks nothing yet, and trusts an engine with TLS by DOCKER_CERT_PATH alone.

    Without this, certificates that REQUESTS_CA_BUNDLE or CURL_CA_BUNDLE name would take the place of those.
    """
    client = docker.from_env(version=version, max_pool_size=_CONNECTIONS)
    client.api.trust_env = not client.api.base_url.startswith("https:")
    return client


def _reason(error: Exception) -> str:
    """What the system says of the engine's socket, without the layers of libraries around it."""
    below: BaseException | None = error
    while below is not None:
        if isinstance(below, OSError) and below.strerror:
            return below.strerror
        below = below.__cause__ or below.__context__
    return str(error)


def refusal(
    client: Any,
    service: str,
    image: str,
    entrypoint: Sequence[str],
    command: Sequence[str],
    variables: Mapping[str, str],
) -> str:
    """Why a container's first program, the compose file's or the image's, cannot have the test's time."""
    config = client.images.get(image).attrs["Config"]
    words = [
        *(entrypoint or config.get("Entrypoint") or ()),
        *(command or (not entrypoint and config.get("Cmd")) or ()),
    ]
    environment = {**dict(each.partition("=")[::2] for each in config.get("Env") or ()), **variables}
    container = client.api.create_container(image, ["-"], entrypoint=["-"])["Id"]

    def look(path: Path) -> tuple[int, bytes] | None:
        for _ in range(_MOST_LINKS):
            try:
                stream, about = client.api.get_archive(container, str(path))
            except NotFound:
                return None
            with contextlib.closing(stream):
                if not about["linkTarget"]:
                    mode, head = about["mode"], b""
                    while len(head) < _HEAD_SIZE and (more := next(stream, b"")):
                        head += more
                    bits = mode & 0o777 | 0o6000 * bool(mode & _CHANGES_USER)
                    return None if mode & _IS_FOLDER else (bits, head[tarfile.BLOCKSIZE :])
            path = Path(about["linkTarget"])
        return None

    try:
        folder = Path(config.get("WorkingDir") or "/")
        return application_time.refusal(service, words[0], environment, folder, look) if words else ""
    finally:
        client.api.remove_container(container, force=True)


def engine_error(error: Exception) -> str:
    """The engine's explanation of an error without the client's text around it, or the system's."""
    return str(getattr(error, "explanation", None) or getattr(error, "strerror", None) or error)


async def run(
    words: Sequence[str], folder: Path, environment: Mapping[str, str], log: Path | None = None
) -> tuple[int, str]:
    """Exit code and the last line of standard error of a docker command, which ends when this is cancelled."""
    process = await asyncio.create_subprocess_exec(
        *_YIELDING, "docker", *words, cwd=folder, env=environment, stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        out, err = await process.communicate()
    except asyncio.CancelledError:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()
        raise
    if log is not None:
        atomic.write_bytes(log, out + err)
    errors = [line for line in err.decode("utf-8", "replace").splitlines() if line.strip()]
    return process.returncode or 0, errors[-1].strip() if errors else ""
