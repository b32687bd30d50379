"""Commands that messages propose, for this user and Python, in any folder."""

import grp
import importlib
import json
import os
import pwd
import re
import shlex
import shutil
import sys
import sysconfig
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from dodo_dsl import package_data

_LOADED = {
    "mcap": ("mcap.writer", "mcap_protobuf.schema", "foxglove_schemas_protobuf"),
    "ros": ("rosbags.rosbag2", "cyclonedds.core"),
    "search": ("optuna", "scipy"),
    "storage": ("psycopg",),
}
"""Modules of what each extra of DoDo installs, which load what they need themselves."""
_DISTRIBUTION = "dodo-dsl"
_PAGE = "https://docs.docker.com/engine/install"
_SOCKET = Path("/var/run/docker.sock")


def missing(extra: str) -> str:
    """The first module that this Python lacks for an extra; empty if it has all."""
    for module in _LOADED[extra]:
        try:
            importlib.import_module(module)
        except ImportError as error:  # psycopg's has no name where it finds no library of PostgreSQL
            return (error.name or module).partition(".")[0]
    return ""


def install(extra: str) -> str:
    """A command that installs what an extra needs into the Python that runs DoDo.

    DoDo is on no package index, so the command names the checkout that it was installed from, or else the packages.
    """
    checkout = _installed_from()
    packages = [f"{checkout}[{extra}]"] if checkout else _packages(extra)
    command = shlex.join([sys.executable, "-m", "pip", "install", *packages])
    return command if os.access(sysconfig.get_path("purelib"), os.W_OK) else as_root(command)


def _packages(extra: str) -> list[str]:
    """What an installed DoDo says that the extra needs."""
    rows = metadata.requires(_DISTRIBUTION) or []
    return [row.partition(";")[0].strip() for row in rows if re.search(f"extra == ['\"]{extra}['\"]", row)]


def _installed_from() -> Path | None:
    """The checkout that DoDo runs from, or was installed from by what pip noted (PEP 610)."""
    try:
        noted = json.loads(metadata.distribution(_DISTRIBUTION).read_text("direct_url.json") or "{}")
        folder = Path(unquote(urlsplit(noted["url"]).path))
    except (metadata.PackageNotFoundError, KeyError, TypeError, ValueError, OSError):
        return package_data.checkout()
    return folder if package_data.is_checkout(folder) else package_data.checkout()


def as_root(*commands: str) -> str:
    """Commands for root, one after the other, in the form for this user."""
    return " && ".join(commands if os.geteuid() == 0 else [f"sudo {command}" for command in commands])


def docker() -> str:
    """How to get the docker command."""
    return f"install Docker Engine with its command line ({_PAGE})"


def docker_plugin(name: str) -> str:
    """How to get Compose v2 or buildx."""
    return _script("install-compose") or f"install docker-{name}-plugin from Docker's own repository ({_PAGE})"


def engine() -> str:
    """How to make a Docker engine answer."""
    if host := os.environ.get("DOCKER_HOST"):
        is_job = os.environ.get("GITLAB_CI") and host.startswith("tcp://")
        there = "give this job the service that is the engine, and wait for it" if is_job else "start the engine there"
        return f"DOCKER_HOST is {host}: {there}, or unset DOCKER_HOST"
    if _SOCKET.exists() and not os.access(_SOCKET, os.W_OK):
        return join(_SOCKET)
    if script := _script("start-engine"):
        return script
    if not shutil.which("dockerd"):
        return docker()
    return as_root("systemctl start docker" if Path("/run/systemd/system").is_dir() else "dockerd")


def join(device: Path) -> str:
    """How this user may use a device or socket: by the group that may."""
    status = device.stat()
    if status.st_mode & 0o060 != 0o060 or status.st_gid == 0:
        return "only root may use it"
    words = ["usermod", "--append", "--groups", _name(grp.getgrgid, status.st_gid), _name(pwd.getpwuid, os.getuid())]
    return f"{as_root(shlex.join(words))}, and log in again"


def _name(look_up: Callable[[int], Any], number: int) -> str:
    """Of a user or group, or its number."""
    try:
        return str(look_up(number)[0])
    except KeyError:
        return str(number)


def _script(name: str) -> str:
    """A script of the checkout that installs what is missing, if it can: for root, if there is apt."""
    checkout = package_data.checkout()
    can = checkout and os.geteuid() == 0 and shutil.which("apt-get")
    return shlex.quote(str(checkout / "scripts" / name)) if checkout and can else ""


def firmware(variable: str) -> str:
    """How to build the emulated rig; ``variable`` names its folder."""
    if named := os.environ.get(variable):
        return f"{variable} is {named}: build it there, or unset {variable}"
    if checkout := _installed_from():
        make, built = (
            f"make -C {shlex.quote(str(checkout))} firmware",
            shlex.quote(str(checkout / "build" / "firmware")),
        )
        return make if package_data.checkout() else f"{make} && export {variable}={built}"
    return f"'make firmware' in a checkout of DoDo, then export {variable}=CHECKOUT/build/firmware"
