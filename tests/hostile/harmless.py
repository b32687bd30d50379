"""What no compiled application may have, whatever its compose file says: one property for all attacks."""

import contextlib
import json
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.application.compiled import size

Document = Mapping[str, Any]

_CARRIED = """
build cap_add cap_drop command configs cpus cpuset depends_on deploy dns dns_opt dns_search domainname entrypoint
env_file environment expose extra_hosts gpus group_add healthcheck hostname image init ipc links logging mem_limit
network_mode networks pid pids_limit platform read_only runtime secrets security_opt shm_size stdin_open
stop_grace_period stop_signal tmpfs tty ulimits umask user volumes volumes_from working_dir
"""
KEYS = {*_CARRIED.split()}
"""Those of a service that a test carries; any other is harm. Their values are judged below."""
_BUILT = "additional_contexts args context dockerfile dockerfile_inline network secrets target"
MOUNT = {
    "": {"bind", "read_only", "source", "target", "tmpfs", "type", "volume"},
    "bind": {"create_host_path"},
    "volume": {"nocopy"},
}
TOP = {"services", "volumes", "secrets", "configs"}
MEMORY, FILES = 2_000_000_000, 1_000_000_000
ULIMITS = {"core": 0, "nofile": 1024, "fsize": FILES, "nproc": 1024, "memlock": MEMORY, "msgqueue": MEMORY}
LOGS = {"driver": "json-file", "options": {"max-size": "50m", "max-file": "2"}}
DROPPED = {"AUDIT_WRITE", "MKNOD", "NET_RAW", "SETFCAP", "SYS_CHROOT"}
_OWN = "CHOWN DAC_OVERRIDE FOWNER FSETID IPC_LOCK KILL NET_BIND_SERVICE SETGID SETPCAP SETUID SYS_NICE SYS_PTRACE"
ADDED = {"AUDIT_WRITE", "SETFCAP", "SYS_CHROOT", *_OWN.split()}
TO_READ = (
    *("/usr/share", "/usr/src", "/lib/modules", "/lib/firmware", "/etc/localtime", "/etc/timezone", "/run/udev/data"),
    *(f"/sys/{name}" for name in ("block", "bus", "class", "dev", "devices", "module")),
)
URLS = ("http://", "https://", "git://", "ssh://", "git@", "github.com/", "docker-image://", "service:", "target:")
OWN_VOLUMES = re.compile(r"tmp|report|dodo-time|files-\d+")


def is_harmless(document: Document, repository: Path) -> bool:
    """Whether the application of an isolated test has nothing of the host, of other tests, or without a limit."""
    return not list(harm(document, repository))


def harm(document: Document, repository: Path) -> Iterator[str]:
    """What the document of a test in ``generated`` has and may not have; its variables are filled in."""
    folder = repository / "generated" / "network"
    if "\\u0000" in json.dumps(document):
        yield "a NUL"
        return
    yield from _others(document, TOP, "of the file")
    names, volumes = set(document["services"]), document.get("volumes") or {}
    for name, service in document["services"].items():
        found = [
            *_others(service, KEYS, ""),
            *_namespaces(service, names | {"sandbox"}),
            *_privileges(service),
            *_limits(service),
            *(text for mount in service.get("volumes") or () for text in _mount(mount, volumes, folder, repository)),
            *_build(service.get("build") or {}, folder, repository),
            *_files(service, folder, repository),
        ]
        yield from (f"{name}: {text}" for text in found)
    for name, volume in volumes.items():
        yield from (f"volume {name}: {text}" for text in _volume(volume or {}))
    for key in ("secrets", "configs"):
        for name, about in (document.get(key) or {}).items():
            yield from (f"{key} {name}: {text}" for text in _content(about or {}, folder, repository))


def _others(mapping: Document, known: set[str], where: str) -> Iterator[str]:
    for key, value in mapping.items():
        if key not in known and not key.startswith("x-") and value not in (None, False, "", [], {}):
            yield f"{key} {where}"


def _namespaces(service: Document, names: set[str]) -> Iterator[str]:
    for key in ("network_mode", "ipc", "pid"):
        kind, _, name = str(service.get(key) or "none").partition(":")
        is_own = kind == "service" and name in names
        if (
            kind in ("host", "container")
            or (key != "pid" and kind != "none" and not is_own)
            or (kind == "service" and not is_own)
        ):
            yield f"{key}: {service[key]}"
    if service.get("ipc") is None:
        yield "ipc is not the test's"
    if set(service.get("networks") or ()) - {"default"}:
        yield f"networks: {service['networks']}"
    for entry in service.get("volumes_from") or ():
        if entry.startswith("container:"):
            yield f"volumes_from: {entry}"
    if service.get("runtime") not in (None, "", "runc", "runsc", "nvidia"):
        yield f"runtime: {service['runtime']}"


def _privileges(service: Document) -> Iterator[str]:
    for word in _list(service.get("cap_add")):
        if str(word).upper().removeprefix("CAP_") not in ADDED:
            yield f"cap_add: {word}"
    dropped = {str(word).upper().removeprefix("CAP_") for word in service.get("cap_drop") or ()}
    if "ALL" not in dropped and DROPPED - dropped:
        yield f"keeps {DROPPED - dropped}"
    options = _list(service.get("security_opt"))
    if not options or not all(re.match(r"no-new-privileges\b", str(option)) for option in options):
        yield f"security_opt: {options}"
    deploy = service.get("deploy") or {}
    reserved = _at(deploy, "resources", "reservations", "devices") or []
    for device in [*reserved, *(service.get("gpus") if isinstance(service.get("gpus"), list) else [])]:
        if str(device.get("driver")).lower() == "cdi" or any("=" in str(i) for i in device.get("device_ids") or ()):
            yield f"device {device}"
    if deploy not in ({}, {"resources": {"reservations": {"devices": reserved}}}):
        yield f"deploy: {deploy}"


def _limits(service: Document) -> Iterator[str]:
    for key, most in (("pids_limit", 1024), ("mem_limit", MEMORY)):
        if key not in service or _beyond(service[key], most, 1):
            yield f"{key}: {service.get(key)}"
    if "shm_size" in service and _beyond(service["shm_size"], MEMORY):
        yield f"shm_size: {service['shm_size']}"
    ulimits = service.get("ulimits") or {}
    if {"core", "nofile", "fsize"} - set(ulimits):
        yield f"ulimits: {ulimits}"
    for name, value in ulimits.items():
        numbers = value.values() if isinstance(value, dict) else [value]
        if name in ULIMITS and any(_beyond(number, ULIMITS[name]) for number in numbers):
            yield f"ulimits: {name} {value}"
    for entry in _list(service.get("tmpfs")):
        yield from _tmpfs(str(entry).partition(":")[2])
    if service.get("logging") != LOGS:
        yield f"logging: {service.get('logging')}"


def _beyond(value: Any, most: int, least: int = 0) -> bool:
    """Whether a size is none that a test may have; what is no size is nothing that compose takes."""
    with contextlib.suppress(ValueError):
        return not least <= size(value) <= most
    return False


def _tmpfs(options: str) -> Iterator[str]:
    sizes = [word[5:] for word in options.split(",") if word.startswith("size=")]
    if not sizes or any("%" in text or _beyond(text, MEMORY, 1) for text in sizes) or "nr_blocks" in options:
        yield f"a tmpfs of '{options}'"


def _mount(mount: Any, volumes: Document, folder: Path, repository: Path) -> Iterator[str]:
    if isinstance(mount, dict):
        kind, source, is_read = mount.get("type"), str(mount.get("source") or ""), bool(mount.get("read_only"))
        for key, known in MOUNT.items():
            yield from _others((mount.get(key) or {}) if key else mount, known, "of a mount")
        if mount.get("tmpfs") or kind == "tmpfs":
            yield from _tmpfs(f"size={_at(mount, 'tmpfs', 'size') or 0}")
    else:
        source, _, rest = mount.partition(":") if ":" in mount else ("", "", mount)
        words = rest.split(":")[1].split(",") if ":" in rest else []
        kind = "bind" if source.startswith((".", "/", "~")) else "volume"
        is_read = [word for word in words if word in ("ro", "rw")][-1:] == ["ro"]
        if {*words} & {"shared", "rshared", "slave", "rslave"}:
            yield f"mount {mount}"
    if kind == "bind":
        yield from _bound(source, is_read, folder, repository)
    elif kind == "volume" and source:
        if source not in volumes and not OWN_VOLUMES.fullmatch(source):
            yield f"volume '{source}' of nobody"
        if _is_external(volumes.get(source)) and not is_read:
            yield f"mount {mount} could be written to"
    elif kind not in ("volume", "tmpfs", None):
        yield f"mount {mount}"


def _bound(source: str, is_read: bool, folder: Path, repository: Path) -> Iterator[str]:
    if source == "/dev/null":
        return
    if not _is_own(source, folder, repository) and not _is_to_read(source, folder):
        yield f"a mount of '{source}'"
    if not is_read:
        yield f"'{source}' could be written to"


def _build(build: Any, folder: Path, repository: Path) -> Iterator[str]:
    build = {"context": build} if isinstance(build, str) else build
    yield from _others(build, {*_BUILT.split()}, "of a build")
    context = str(build.get("context") or ".")
    contexts = build.get("additional_contexts") or {}
    others = [str(word).partition("=")[2] for word in contexts] if isinstance(contexts, list) else contexts.values()
    is_here = not context.startswith(URLS)
    for path in [context, *others] if build else []:
        if path and not str(path).startswith(URLS) and not _is_own(str(path), folder, repository):
            yield f"a build from '{path}'"
    file = build.get("dockerfile")
    if file and is_here and not _is_own(os.path.join(context, file), folder, repository):  # noqa: PTH118
        yield f"a build by '{file}'"
    if build.get("network") not in (None, "", "none", "default"):
        yield f"a build on {build['network']}"


def _files(service: Document, folder: Path, repository: Path) -> Iterator[str]:
    for entry in _list(service.get("env_file")):
        path = entry["path"] if isinstance(entry, dict) else entry
        if not _is_own(str(path), folder, repository):
            yield f"env_file: {path}"


def _content(about: Document, folder: Path, repository: Path) -> Iterator[str]:
    yield from _others(about, {"file", "content", "environment"}, "")
    if about.get("file", "/dev/null") != "/dev/null" and not _is_own(str(about["file"]), folder, repository):
        yield f"file: {about['file']}"
    if re.match("CI_|DODO_", str(about.get("environment") or "")):
        yield f"environment: {about['environment']}"


def _volume(volume: Document) -> Iterator[str]:
    yield from _others(volume, {"external", "name"} if _is_external(volume) else set(), "")
    name = str(volume.get("name") or "a")
    if _is_external(volume) and (
        volume["external"] is not True or not re.fullmatch("(?!dodo-)[a-zA-Z0-9][a-zA-Z0-9_.-]*", name)
    ):
        yield f"external: {volume}"


def _is_external(volume: Any) -> bool:
    return (volume or {}).get("external") not in (None, False, "")


def _is_own(path: str, folder: Path, repository: Path) -> bool:
    """Whether a path, and what it leads to, lies in the repository, and not where Git, tests or reports are kept."""
    if path.startswith("~") or "\0" in path:
        return False
    whole, real = Path(os.path.normpath(folder / path)), _real(folder / path)
    held = ("tests", ".git", "generated", "dodo-report")
    places = [(whole, repository), (real, _real(repository))]
    return all(
        p.is_relative_to(root) and p.relative_to(root).parts[:1] not in {(name,) for name in held} for p, root in places
    )


def _is_to_read(path: str, folder: Path) -> bool:
    places = [Path(place) for name in TO_READ for place in (name, os.path.realpath(name))]
    real = (Path(os.path.normpath(folder / path)), _real(folder / path))
    return all(any(one.is_relative_to(place) for place in places) for one in real)


def _real(path: Path) -> Path:
    with contextlib.suppress(OSError):  # of a process of the host
        return Path(os.path.realpath(path))
    return path


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [] if value in (None, "") else [value]


def _at(value: Any, *steps: str) -> Any:
    for step in steps:
        value = (value or {}).get(step) if isinstance(value, dict) else None
    return value
