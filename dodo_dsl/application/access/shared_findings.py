"""What the volumes, secrets and configs of a compose file may not be."""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import secret_variables
from dodo_dsl.application.access.compose_keys import CONFIG, NETWORK, SECRET, TOP, VOLUME, Rows
from dodo_dsl.application.access.host_paths import ASK, INSIDE, HostPaths
from dodo_dsl.application.access.model import AccessFinding, key_findings
from dodo_dsl.diagnostics import did_you_mean

OWN_VOLUMES = ("tmp", "report")
"""The names of DoDo's own volumes in a test; an application's volumes of these names get others."""
_TABLES: dict[str, tuple[str, Rows]] = {
    "volumes": ("the volume", VOLUME),
    "secrets": ("the secret", SECRET),
    "configs": ("the config", CONFIG),
    "networks": ("the network", NETWORK),
}
_TMPFS_OPTIONS = re.compile(r"(size|mode|uid|gid|nr_inodes|nr_blocks)=[\w%]+|nosuid|nodev|noexec|rw|ro|noatime")
_BIND_OPTIONS = re.compile(r"r?bind|rw|ro|nosuid|nodev|noexec")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_OURS = "dodo-"
_OPTIONS = "use a tmpfs (type: tmpfs), or a folder of the repository (o: bind)"
_OF_SERVICES = ("image", "build", "command", "x-dodo", "x-dodo-process")


def shared_findings(
    document: Mapping[str, Any], paths: HostPaths, passed: Collection[str], compiled: bool = False
) -> Iterator[AccessFinding]:
    """Everything beside the services, in a mapping of the file's other keys; in a ``compiled`` test compose names all.

    Its network is DoDo's.
    """
    for finding in key_findings("the compose file", TOP, document):
        about = document.get(str(finding.steps[0])) if finding.kind == "unknown" else None
        is_service = isinstance(about, dict) and any(key in about for key in _OF_SERVICES)
        yield replace(finding, hint="indent it by 2: it looks like a service", fix=None) if is_service else finding
    for key, (what, rows) in _TABLES.items():
        entries = document.get(key)
        for name, about in entries.items() if isinstance(entries, dict) else ():
            if isinstance(about, dict):
                seen = {word: value for word, value in about.items() if word != "name"} if compiled else about
                is_judged = compiled and key != "networks" and name not in OWN_VOLUMES
                yield from (f.below(key, name) for f in key_findings(f"{what} '{name}'", rows, seen, is_judged))
                yield from (f.below(key, name) for f in _values(key, name, about, paths, passed))


def _values(
    key: str, name: str, about: dict[str, Any], paths: HostPaths, passed: Collection[str]
) -> Iterator[AccessFinding]:
    if key == "volumes":
        yield from _volume(name, about, paths)
    elif key in ("secrets", "configs"):
        yield from _content(key.removesuffix("s"), name, about, paths, passed)


def _content(
    what: str, name: str, about: dict[str, Any], paths: HostPaths, passed: Collection[str]
) -> Iterator[AccessFinding]:
    file = about.get("file")
    if isinstance(file, str) and (problem := paths.file_problem(file)):
        yield AccessFinding(("file",), problem, ASK)
    variable = about.get("environment")
    if isinstance(variable, str) and secret_variables.is_of_pipeline(variable) and variable not in passed:
        message = f"the {what} '{name}' is '{variable}', which belongs to the pipeline and not to the application"
        yield AccessFinding(("environment",), message, f"to allow it, write environment: [{variable}] in dodo.yml")


def _volume(name: str, about: dict[str, Any], paths: HostPaths) -> Iterator[AccessFinding]:
    driver = str(about.get("driver") or "local")
    if driver != "local" and "$" not in driver:
        message = f"the driver '{driver}' of the volume '{name}' reaches beyond the test"
        yield AccessFinding(("driver",), message, "remove it, so that the engine makes a volume of its own")
    external = about.get("external")
    called = str((external.get("name") if isinstance(external, dict) else about.get("name")) or name)
    is_ours = host_access.is_external(about) and called.startswith(_OURS)
    if "$" not in called and (is_ours or not _NAME.fullmatch(called)):
        yield AccessFinding(("name",), f"'{called}' is not a name that a volume of the application may have")
    options = about.get("driver_opts")
    if options and not isinstance(options, dict):
        yield AccessFinding(("driver_opts",), f"'driver_opts' of the volume '{name}' is not a mapping", _OPTIONS)
    if isinstance(options, dict) and options and driver == "local":
        yield from (f.below("driver_opts") for f in _options(name, options, paths))


def _options(name: str, options: dict[str, Any], paths: HostPaths) -> Iterator[AccessFinding]:
    """A tmpfs, or a folder that may be mounted; with other options the engine mounts disks and shares of networks."""
    kind, flags = str(options.get("type") or ""), str(options.get("o") or "")
    device = str(options.get("device") or "")
    unknown = [key for key in options if key not in ("type", "o", "device")]
    for key in unknown:
        message = f"unknown option '{key}' of the volume '{name}'"
        yield AccessFinding((key,), message, did_you_mean(str(key), ("type", "o", "device")))
    if unknown or "$" in f"{kind}{flags}":
        return
    words = [word.strip() for word in flags.split(",") if word.strip()]
    if {"bind", "rbind"} & set(words):
        if not all(_BIND_OPTIONS.fullmatch(word) for word in words):
            yield AccessFinding(("o",), f"'{flags}' of the volume '{name}' has other options than bind, ro and rw")
        problem, hint = _bind_problem(device, paths)
        if problem:
            yield AccessFinding(("device",), problem, hint)
    elif kind != "tmpfs" or not all(_TMPFS_OPTIONS.fullmatch(word) for word in words):
        message = f"the volume '{name}' mounts '{kind or flags or device}', which reaches beyond the test"
        yield AccessFinding(("type",) if kind else ("o",) if flags else (), message, _OPTIONS)


def _bind_problem(device: str, paths: HostPaths) -> tuple[str, str]:
    if paths.is_open(device):
        return "", ""
    if link := paths.link(device):
        return f"'{device}' is a symbolic link to '{link}', outside the repository", INSIDE
    for name in paths.names(device):
        seen = host_access.Mount(name, "", read_only=False)
        if host_access.is_machine(seen) or host_access.is_hardware(seen) or host_access.is_of_machine(name):
            return f"'{device}' belongs to the host, so tests would share it", "mount a folder of the repository"
    return paths.mount_problem(device)
