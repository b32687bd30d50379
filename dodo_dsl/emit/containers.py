"""A planned service as a container: command, volumes and what it waits for."""

import math
import posixpath
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dodo_dsl.application.mounts import WAY_OUT
from dodo_dsl.plan.added_services import CLOCK, RUNNER_VARIABLE
from dodo_dsl.plan.model import LAYERS, READY_S, Application, Flag, Plan, PlannedService
from dodo_dsl.plan.test_files import SHARED

FILES = "/dodo/files"
REPORT = "/dodo/report"
FILES_MOUNT: Mapping[str, Any] = {
    "type": "bind",
    "source": "./files",
    "target": FILES,
    "read_only": True,
    "bind": {"create_host_path": False},
}
"""In the long form, as the folder above may have a colon in its name."""
_TRIES_A_SECOND = 2


@dataclass(frozen=True)
class Container:
    """What the layer template needs of a service; ``after`` holds names with compose's condition.

    ``ready_tries`` is how often its ready file is checked, twice a second. ``groups`` are those that may open devices.
    """

    name: str
    image: str
    command: tuple[str, ...]
    volumes: tuple[str | Mapping[str, Any], ...]
    ready_file: str
    ready_tries: int
    after: tuple[tuple[str, str], ...]
    environment: tuple[tuple[str, str], ...]
    devices: tuple[str, ...]
    groups: tuple[str, ...]


def containers(plan: Plan, layer: str) -> list[Container]:
    """The containers of a layer, each waiting for the layers before it."""
    earlier = LAYERS[: LAYERS.index(layer)]
    after = [(s.name, "service_healthy") for name in earlier for s in plan.layer(name)]
    if plan.isolation == "network":
        after.insert(0, ("sandbox", "service_started"))
    return [
        Container(
            service.name,
            service.image,
            tuple(_word(flag) for flag in service.flags),
            _volumes(plan, service),
            f"/tmp/dodo-ready-{service.name}",
            math.ceil(_TRIES_A_SECOND * (READY_S + service.setup_s)),
            tuple(after),
            _environment(plan, service),
            service.devices,
            ("dialout",) if service.port else ("video",) if service.devices else (),
        )
        for service in plan.layer(layer)
    ]


_COUNT = """\
files=0 size=0
fits() {
  own=$(find "$1" -mindepth 1 | head -n %(most)s | wc -l); files=$((files + own))
  [ $files -le %(files)s ] || fail "$2" "at least $own files" "%(files)s" copied-files
  own=$(du -sk --apparent-size "$1" | cut -f1); size=$((size + own))
  [ $size -le %(size)s ] || fail "$2" "$((own * 128 / 125000)) MB" "%(shown)s MB" copies
}
fail() {
  echo "'$1' holds $2, and the copies of a test may hold $3: %(way_out)s"
  exit 1
}
"""


def copy_command(application: Application) -> str:
    """What the service does that copies folders of the repository: links stay links, and nothing follows them.

    It counts before it copies. Variables are for the shell: compose fills in none.
    """
    copies, limits = application.copies, application.limits
    count = _COUNT % {
        "most": limits.copied_files + 1,
        "files": limits.copied_files,
        "size": limits.copies // 1024,
        "shown": limits.copies // 10**6,
        "way_out": WAY_OUT.format(key="$4"),
    }
    shown = {name: _as_written(source, application.folder) for name, source in copies.items()}
    words = [f"fits {shlex.quote(f'/from/{name}')} {shlex.quote(source)}" for name, source in shown.items()]
    words += [f"cp -a {shlex.quote(f'/from/{name}')}/. {shlex.quote(f'/to/{name}')}/" for name in copies]
    return f"{count}{' && '.join([*words, 'touch /run/copied', 'exec sleep infinity'])}".replace("$", "$$")


def _as_written(source: str, folder: str) -> str:
    """A path of the compiled test as it is in the application's compose file, relative to its ``folder``."""
    if source.startswith(("/", "$", "~")):
        return source
    relative = posixpath.relpath(source, folder)
    return relative if relative == "." else f"./{relative}"


def _word(flag: Flag) -> str:
    """``--name=value`` with container paths, with ``$`` doubled for compose."""
    folder = {"path": f"{FILES}/", "report": f"{REPORT}/"}.get(flag.kind, "")
    return f"--{flag.name}={folder}{flag.value}".replace("$", "$$")


def _environment(plan: Plan, service: PlannedService) -> tuple[tuple[str, str], ...]:
    messages = ":".join(f"{FILES}/{path}" for path in plan.messages)
    own = {"DODO_SERVICE": service.name, "DODO_ODVD": messages, **plan.variables}
    if service.name == CLOCK:
        own[RUNNER_VARIABLE] = f"${{{RUNNER_VARIABLE}:-}}"  # the runner sets it: without one the clock begins by itself
    return tuple((name, value) for name, value in own.items() if value)


def _shared(plan: Plan, service: PlannedService) -> list[str]:
    """The shared files to which the service's own paths lead."""
    paths = {*plan.messages, *(flag.value for flag in service.flags if flag.kind == "path")}
    found = {name for target, name in plan.shared.items() if any(f"{target}/".startswith(f"{p}/") for p in paths)}
    return sorted(found)


def _shared_mount(name: str) -> Mapping[str, Any]:
    """The position to which the test's link leads in a container."""
    return {**FILES_MOUNT, "source": f"../{SHARED}/{name}", "target": f"/{SHARED}/{name}"}


def _volumes(plan: Plan, service: PlannedService) -> tuple[str | Mapping[str, Any], ...]:
    kinds = {flag.kind for flag in service.flags}
    volumes: list[str | Mapping[str, Any]] = ["tmp:/tmp" if plan.isolation == "network" else "/tmp:/tmp"]
    if "path" in kinds or plan.messages:
        volumes += [FILES_MOUNT, *(_shared_mount(name) for name in _shared(plan, service))]
    if "report" in kinds:
        volumes.append(f"report:{REPORT}")
    return tuple(volumes)
