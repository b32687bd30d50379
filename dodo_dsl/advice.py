"""Commands that messages propose. Each works where it is shown: for this user and Python, in any folder."""

import grp
import importlib
import importlib.util
import json
import os
import pwd
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from dodo_dsl import package_data

PACKAGES = {
    "lsp": ("pygls",),
    "mcap": ("foxglove-schemas-protobuf", "mcap", "mcap-protobuf-support"),
    "ros": ("cyclonedds==11.0.1", "rosbags"),
    "search": ("scipy",),
    "storage": ("psycopg[binary]",),
}
"""What each extra of DoDo installs."""
_LOADED = {
    "lsp": ("pygls.lsp.server", "lsprotocol.types"),
    "mcap": ("mcap.writer", "mcap_protobuf.schema", "foxglove_schemas_protobuf"),
    "ros": ("rosbags.rosbag2", "cyclonedds.core"),
    "search": ("scipy",),
    "storage": ("psycopg",),
}
"""Modules of these, which load what they need themselves."""
_OF_SETUP = ("lsp", "mcap", "search")
"""Extras that ``scripts/setup`` installs."""
_DISTRIBUTION = "dodo-dsl"
_PLUGINS = {
    "buildx": ("docker-buildx-plugin", "docker-buildx"),
    "compose": ("docker-compose-plugin", "docker-compose-v2", "docker-compose"),
}
"""Their packages: Docker's own, and those of Ubuntu and Debian 13. Debian 12 has only Compose 1."""
_LEAST = {"buildx": 0, "compose": 2}
_DOCKER = ("docker-ce", "docker.io")
_CANDIDATE = re.compile(r"Candidate: (?:\d+:)?(\d+)")
_ENGLISH = {"PATH": os.defpath, "LC_ALL": "C"}
_PAGE = "https://docs.docker.com/engine/install"
_SOCKET = Path("/var/run/docker.sock")
_APT_S = 10.0


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

    DoDo is on no package index, so the command names the checkout that DoDo is from, or else the packages.
    """
    checkout = package_data.checkout()
    if checkout and Path(sys.prefix).resolve() == checkout / ".venv" and extra in _OF_SETUP:
        return shlex.quote(str(checkout / "scripts" / "setup"))
    return _pip(_source(extra) or [*PACKAGES[extra]])


def as_root(*commands: str) -> str:
    """Commands for root, one after the other, in the form for this user."""
    return " && ".join(commands if os.geteuid() == 0 else [f"sudo {command}" for command in commands])


def docker() -> str:
    """How to get the docker command."""
    return _by_apt(_DOCKER) or f"install Docker Engine with its command line ({_PAGE})"


def docker_plugin(name: str) -> str:
    """How to get Compose v2 or buildx."""
    if command := _by_apt(_PLUGINS[name], _LEAST[name]):
        return command
    if script := _script("install-compose"):
        return script
    return f"install {_PLUGINS[name][0]} from Docker's own repository ({_PAGE})"


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
    if checkout := package_data.checkout():
        return f"make -C {shlex.quote(str(checkout))} firmware"
    if folder := _installed_from()[0]:
        built = shlex.quote(str(folder / "build" / "firmware"))
        return f"make -C {shlex.quote(str(folder))} firmware && export {variable}={built}"
    return f"'make firmware' in a checkout of DoDo, then export {variable}=CHECKOUT/build/firmware"


def _source(extra: str) -> list[str]:
    """The checkout that DoDo was installed from, with an extra; nothing if there is none, or not any more."""
    folder, is_editable = _installed_from()
    return [*(["--editable"] if is_editable else []), f"{folder}[{extra}]"] if folder else []


def _installed_from() -> tuple[Path | None, bool]:
    """The checkout by what pip noted (PEP 610), and whether DoDo runs from there."""
    try:
        noted = json.loads(metadata.distribution(_DISTRIBUTION).read_text("direct_url.json") or "{}")
        folder = Path(unquote(urlsplit(noted["url"]).path))
        is_there = "dir_info" in noted and package_data.is_checkout(folder)
    except (metadata.PackageNotFoundError, KeyError, TypeError, ValueError, OSError):
        return None, False
    return (folder, bool(noted["dir_info"].get("editable"))) if is_there else (None, False)


def _pip(what: list[str]) -> str:
    """pip's command for the Python that runs DoDo; environments of uv have no pip, and DoDo's image has none."""
    python, words = sys.executable, ["install", *what]
    if importlib.util.find_spec("pip") is None and shutil.which("uv"):
        return _for_owner(shlex.join(["uv", "pip", "install", "--python", python, *what]))
    if importlib.util.find_spec("pip") is None:
        commands = [shlex.join([python, "-m", "ensurepip"]), shlex.join([python, "-m", "pip", *words])]
        return _for_owner(*commands)
    found = shutil.which("pip")
    is_active = sys.prefix != sys.base_prefix and found and Path(found).parent == Path(python).parent
    return _for_owner(shlex.join(["pip" if is_active else python, *([] if is_active else ["-m", "pip"]), *words]))


def _for_owner(*commands: str) -> str:
    """Commands that write where this Python has its packages."""
    return " && ".join(commands) if os.access(sysconfig.get_path("purelib"), os.W_OK) else as_root(*commands)


def _by_apt(packages: tuple[str, ...], least: int = 0) -> str:
    """Installs the first package that apt has in this major version or a later one; empty if there is none."""
    apt = shutil.which("apt-cache")
    for name in packages if apt else ():
        words = [str(apt), "policy", name]
        try:
            told = subprocess.run(words, env=_ENGLISH, capture_output=True, text=True, check=False, timeout=_APT_S)
        except (OSError, subprocess.TimeoutExpired):
            return ""
        candidate = _CANDIDATE.search(told.stdout)
        if candidate and int(candidate[1]) >= least:
            return as_root(f"apt install {name}")
    return ""
