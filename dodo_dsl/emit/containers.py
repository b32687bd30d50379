"""A planned service as a container: command, volumes and what it waits for."""

import math
import posixpath
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dodo_dsl.opendlv.address import CHANNEL_VARIABLE
from dodo_dsl.plan.added_services import ANSWERS_VARIABLE, CLOCK, RUNNER_VARIABLE
from dodo_dsl.plan.model import LAYERS, READY_S, Application, Flag, Plan, PlannedService
from dodo_dsl.plan.test_files import SHARED

FILES = "/dodo/files"
REPORT = "/dodo/report"
CHANNEL = "/dodo/channel"
FILES_MOUNT: Mapping[str, Any] = {
    "type": "bind",
    "source": "./files",
    "target": FILES,
    "read_only": True,
    "bind": {"create_host_path": False},
}
"""In the long form, as the folder above may have a colon in its name."""
_TRIES_A_SECOND = 2
WAY_OUT = "mount it read-only (:ro), name it under 'paths' in dodo.yml, or raise '{key}' in 'sandbox' there"


READY_TRIES = math.ceil(_TRIES_A_SECOND * READY_S)

Defaults = Mapping[str, Mapping[str, str]]
"""The values that flags of a service have without being given: by the service's manifest, then by the flag."""

_NOTES = {
    "DODO_CLOCK": "Services take the time from dodo-clock, which steps the test, and not from the machine.",
    CHANNEL_VARIABLE: "Where services meet, and say that they are ready; the application has no such folder.",
    "DODO_READERS": "How many programs of the application read each frame; it comes when all are waiting.",
    "DODO_SENDERS": "Who alone may send a message, as message=services; with none behind =, nobody.",
    "DODO_WORLD": "The services that get what the application must not hear.",
    "DODO_TOLD": "What the application gets of that, as it declares in x-dodo.",
    "DODO_TRUTH": "What only evaluators get.",
    ANSWERS_VARIABLE: "Where it is not empty, programs keep the machine's time, and the test waits for their answers.",
    RUNNER_VARIABLE: "dodo run sets it, and begins the test. When it is empty, the test begins by itself.",
}
"""What a reader of a compose file would ask about a variable."""
_LONG = 100


@dataclass(frozen=True)
class Variable:
    """An environment variable of a container; a long list of words has a line for each in ``lines``."""

    name: str
    value: str

    @property
    def note(self) -> str:
        return _NOTES.get(self.name, "")

    @property
    def lines(self) -> tuple[str, ...]:
        words = self.value.split()
        return tuple(words) if len(self.value) > _LONG and " ".join(words) == self.value else ()


@dataclass(frozen=True)
class Container:
    """What the layer template needs of a service beyond what its layer has in common.

    ``ready_tries`` is how often its entry is looked for, twice a second. ``groups`` are those that may open devices.
    """

    name: str
    image: str
    command: tuple[str, ...]
    volumes: tuple[str | Mapping[str, Any], ...]
    ready_tries: int
    environment: tuple[Variable, ...]
    devices: tuple[str, ...]
    groups: tuple[str, ...]


@dataclass(frozen=True)
class Layer:
    """The containers of a layer, and their common variables, volumes and ``after``: names with compose's condition."""

    services: tuple[Container, ...]
    environment: tuple[Variable, ...]
    volumes: tuple[str, ...]
    after: tuple[tuple[str, str], ...]


NO_DEFAULTS: Defaults = {}


def containers(plan: Plan, layer: str, defaults: Defaults = NO_DEFAULTS) -> Layer:
    """A layer, whose containers wait for the layers before it; flags at their ``defaults`` are left out."""
    earlier = LAYERS[: LAYERS.index(layer)]
    after = [(s.name, "service_healthy") for name in earlier for s in plan.layer(name)]
    if plan.isolation == "network":
        after.insert(0, ("sandbox", "service_started"))
    messages = ":".join(f"{FILES}/{path}" for path in plan.messages)
    shared = {**plan.variables, "DODO_ODVD": messages, CHANNEL_VARIABLE: CHANNEL}
    found = tuple(
        Container(
            service.name,
            service.image,
            tuple(_word(flag) for flag in _written(plan, service, defaults)),
            _volumes(plan, service),
            math.ceil(_TRIES_A_SECOND * (READY_S + service.setup_s)),
            _environment(plan, service),
            service.devices,
            ("dialout",) if service.port else ("video",) if service.devices else (),
        )
        for service in plan.layer(layer)
    )
    return Layer(
        found, tuple(Variable(*each) for each in shared.items() if each[1]), tuple(_common(plan)), tuple(after)
    )


def _written(plan: Plan, service: PlannedService, defaults: Defaults) -> list[Flag]:
    """The flags that the spec or the compiler sets, without those that the service has by itself."""
    own, place = defaults.get(service.uses, {}), f"{service.layer}.{service.name}"
    if place not in plan.source_map:
        return list(service.flags)  # the compiler adds the service
    return [f for f in service.flags if own.get(f.name) != f.value or f"{place}.{f.name}" in plan.source_map]


_COPY = """\
files=$(find /from -mindepth 2 | head -n {most} | wc -l)
size=$(du -sk --apparent-size /from | cut -f1)
fail() {{ echo {names}" hold $1, and the copies of a test may hold $2: {way_out}"; exit 1; }}
[ $files -le {files} ] || fail "at least $files files" {files} copied-files
[ $size -le {size} ] || fail "$((size * 128 / 125000)) MB" "{shown} MB" copies
"""


def copy_command(application: Application) -> str:
    """What the service does that copies folders of the repository: links stay links, and nothing follows them.

    It counts before it copies. Variables are for the shell: compose fills in none.
    """
    copies, limits = application.copies, application.limits
    names = ", ".join(f"'{_as_written(source, application.folder)}'" for source in copies.values())
    count = _COPY.format(
        most=limits.copied_files + 1,
        files=limits.copied_files,
        size=limits.copies // 1024,
        shown=limits.copies // 10**6,
        names=shlex.quote(names),
        way_out=WAY_OUT.format(key="$3"),
    )
    words = [f"cp -a /from/{name}/. /to/{name}/" for name in copies]
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


def _environment(plan: Plan, service: PlannedService) -> tuple[Variable, ...]:
    own = {"DODO_SERVICE": service.name}
    if service.name == CLOCK:
        own[RUNNER_VARIABLE] = f"${{{RUNNER_VARIABLE}:-}}"
        own[ANSWERS_VARIABLE] = "1" if plan.isolation == "host" else f"${{{ANSWERS_VARIABLE}:-}}"
    return tuple(Variable(*each) for each in own.items())


def _shared(plan: Plan, service: PlannedService) -> list[str]:
    """The shared files to which the service's own paths lead."""
    paths = {*plan.messages, *(flag.value for flag in service.flags if flag.kind == "path")}
    found = {name for target, name in plan.shared.items() if any(f"{target}/".startswith(f"{p}/") for p in paths)}
    return sorted(found)


def _shared_mount(name: str) -> Mapping[str, Any]:
    """The position to which the test's link leads in a container."""
    return {**FILES_MOUNT, "source": f"../{SHARED}/{name}", "target": f"/{SHARED}/{name}"}


def _common(plan: Plan) -> list[str]:
    """The volumes of all services."""
    tmp = "tmp:/tmp" if plan.isolation == "network" else "/tmp:/tmp"
    return [tmp, f"dodo-channel:{CHANNEL}"]


def _volumes(plan: Plan, service: PlannedService) -> tuple[str | Mapping[str, Any], ...]:
    kinds = {flag.kind for flag in service.flags}
    volumes: list[str | Mapping[str, Any]] = [*_common(plan)]
    if "path" in kinds or plan.messages:
        volumes += [FILES_MOUNT, *(_shared_mount(name) for name in _shared(plan, service))]
    if "report" in kinds:
        volumes.append(f"report:{REPORT}")
    return tuple(volumes)
