"""Programs beside DoDo that some tests need: a Docker engine, Compose, and the emulator of the rig's firmware."""

import contextlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dodo_dsl import advice, package_data
from dodo_dsl.run.capabilities.finding import Capability
from dodo_dsl.run.docker.client import NoEngine, connect
from dodo_dsl.run.docker.shared_files import problem, provide_image, unseen
from dodo_dsl.run.protocol import BackendError

FIRMWARE = "DODO_FIRMWARE"
EMULATOR_PLACES = (package_data.root() / "build" / "firmware", Path("/opt/dodo/firmware"))
_COMPOSE = (2, 20)


def docker_engine() -> Iterator[Capability]:
    """Whether a Docker engine answers."""
    try:
        client = connect()
    except NoEngine as error:
        text = f"none answers ({error.reason}); --backend docker and mixed need one"
        yield Capability("docker engine", "warning", text, error.way)
        return
    with contextlib.closing(client):
        version = client.version()
        where = f" at {host}" if (host := os.environ.get("DOCKER_HOST")) else ""
        tls = " with TLS" if client.api.base_url.startswith("https:") else ""
        text = f"version {version.get('Version')}, API {version.get('ApiVersion')}{where}{tls}"
        yield Capability("docker engine", "ok", text)
        yield from _files_of(client)


def _files_of(client: Any) -> Iterator[Capability]:
    """Whether the engine sees the folders in which tests are, and in which they are compiled."""
    try:
        provide_image(client)
    except BackendError as error:
        yield Capability("files of tests", "warning", f"{error}; --backend docker needs it", "repair the engine")
        return
    with tempfile.NamedTemporaryFile(prefix="dodo-doctor-") as mark:
        for place, path in (("this folder", Path.cwd()), ("TMPDIR", Path(mark.name).resolve())):
            if missing := unseen(client, [path]):
                text, way = problem(missing)
                yield Capability("files of tests", "warning", f"{text}; in {place}, --backend docker needs it", way)
                return
    yield Capability("files of tests", "ok", "the docker engine sees this folder and TMPDIR")


def compose() -> Iterator[Capability]:
    """Whether there is Compose of a version that DoDo supports."""
    text = _output("docker", "compose", "version", "--short")
    numbers = tuple(int(n) for n in text.lstrip("v").split("-")[0].split(".")[:2] if n.isdecimal())
    if numbers >= _COMPOSE:
        yield Capability("compose", "ok", f"version {text}")
        return
    found = f"version {text} is older than 2.20" if numbers else "'docker compose' does not run"
    way = advice.docker_plugin("compose") if shutil.which("docker") else advice.docker()
    yield Capability("compose", "warning", f"{found}; --backend docker and mixed need it", way)


def _output(*command: str) -> str:
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return result.stdout.strip() if result.returncode == 0 else ""


def emulator_folder() -> Path | None:
    """Where the emulated rig is built; None where it is not."""
    return next((p for p in _places() if all((p / name).is_file() for name in ("rig-emulator", "gantry.elf"))), None)


def _places() -> tuple[Path, ...]:
    named = os.environ.get(FIRMWARE)
    return (Path(named),) if named else EMULATOR_PLACES


def emulated_rig() -> Iterator[Capability]:
    """Whether the programs are built that a gantry with ``--serial=emulated`` starts."""
    places = _places()
    if found := emulator_folder():
        yield Capability("emulated rig", "ok", f"is built, in {found}")
    else:
        text = f"is not built: it is not in {' or '.join(map(str, places))}; hil tests need it"
        yield Capability("emulated rig", "warning", text, advice.firmware(FIRMWARE))
