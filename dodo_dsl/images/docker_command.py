"""The docker command: checks that it is complete, and passes on its output."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl import advice


class DockerError(Exception):
    """A part of Docker is missing, or a docker command failed; one sentence."""


def _docker() -> str:
    path = shutil.which("docker")
    if path is None:
        raise DockerError(f"the docker command is missing: {advice.docker()}")
    return path


def ask(*words: str, folder: Path | None = None) -> str:
    """The standard output of a docker command; raises DockerError with the last line of its standard error."""
    command = (_docker(), *words)
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace", check=False)
    if result.returncode:
        said = [line.strip() for line in result.stderr.splitlines() if line.strip()]
        raise DockerError(said[-1] if said else f"docker {words[0]} ended with {result.returncode}")
    return result.stdout.strip()


def require_engine() -> None:
    """Raises DockerError when the docker command is missing or no engine answers it."""
    _docker()
    try:
        ask("version", "--format", "{{.Server.Version}}")
    except DockerError as error:
        raise DockerError(f"no Docker engine answers ({str(error).rstrip('.')}): {advice.engine()}") from None


def require_buildx() -> None:
    """Raises DockerError when docker cannot build with buildx."""
    try:
        ask("buildx", "version")
    except DockerError:
        raise DockerError(f"docker has no buildx: {advice.docker_plugin('buildx')}") from None


def is_local(reference: str) -> bool:
    """Whether the engine has an image."""
    return bool(ask("image", "ls", "--quiet", reference))


def size(reference: str) -> int:
    """Bytes of an image, those of shared layers included."""
    return int(ask("image", "inspect", "--format", "{{.Size}}", reference))


def platform(reference: str) -> str:
    """What an image of the engine is for, such as ``linux/arm64``."""
    return ask("image", "inspect", "--format", "{{.Os}}/{{.Architecture}}", reference)


def show(words: Sequence[str], stdout: TextIO, folder: Path | None = None) -> tuple[int, str]:
    """Runs a docker command with its progress on ``stdout``: exit code, and its output where that is not a terminal.

    On a terminal docker draws by itself; elsewhere its lines are passed on as they come.
    """
    stdout.flush()
    live = stdout.isatty()
    sink = {"stdout": stdout, "stderr": stdout} if live else {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    output = []
    with subprocess.Popen((_docker(), *words), cwd=folder, text=True, errors="replace", **sink) as process:
        try:
            for line in process.stdout or ():
                output.append(line)
                stdout.write(line)
                stdout.flush()
            return process.wait(), "".join(output)
        except BaseException:
            process.terminate()
            raise
