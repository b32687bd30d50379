"""The compose files of a test as data: its layers, ``compose.yaml`` and the folder ``files``."""

import math
import posixpath
import shlex
from collections.abc import Mapping
from typing import Any

from dodo_dsl.application.model import FILES as FILES_SERVICE
from dodo_dsl.application.model import SANDBOX
from dodo_dsl.emit.yaml import Alias
from dodo_dsl.opendlv.address import CHANNEL_VARIABLE
from dodo_dsl.plan.added_services import ANSWERS_VARIABLE, CLOCK, RUNNER_VARIABLE, TIME, TIME_MOUNT, agent_flags
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
WAY_OUT = "mount it read-only (:ro), name it under 'paths' in dodo.yml, or raise '{key}' in 'sandbox' there"
_TRIES_A_SECOND = 2
_IN_MEMORY = {"type": "tmpfs", "device": "tmpfs"}
_CONFINED = {"read_only": True, "cap_drop": ["ALL"], "security_opt": ["no-new-privileges:true"]}


def layer(plan: Plan, name: str) -> dict[str, Any]:
    is_first, own_network = name == LAYERS[0], plan.isolation == "network"
    added: dict[str, Any] = {SANDBOX: _sandbox(plan)} if is_first and own_network else {}
    added |= {FILES_SERVICE: _files(plan)} if is_first and plan.application.copies else {}
    services = {service.name: _service(plan, service) for service in plan.layer(name)}
    shared: dict[str, Any] = {}
    if services:
        messages = ":".join(f"{FILES}/{path}" for path in plan.messages)
        variables = {**plan.variables, "DODO_ODVD": messages, CHANNEL_VARIABLE: CHANNEL}
        after = {s.name: {"condition": "service_healthy"} for n in LAYERS[: LAYERS.index(name)] for s in plan.layer(n)}
        shared["x-environment"] = {key: value for key, value in variables.items() if value}
        shared["x-service"] = {
            "init": True,
            **_CONFINED,
            "stop_grace_period": "3s",
            "cpu_shares": 2048,  # twice the application's: on a busy machine, the application has to wait first
            "labels": {"dodo.test": plan.slug, "dodo.layer": name},
            **({"ipc": f"service:{SANDBOX}"} if own_network else {"network_mode": "host", "ipc": "host"}),
            "volumes": _common(plan),
            "depends_on": {**({SANDBOX: {"condition": "service_started"}} if own_network else {}), **after},
        }
    made = {**shared, "services": {**added, **services}}
    return {**made, **_rest(plan, own_network)} if is_first else made


def _rest(plan: Plan, own_network: bool) -> dict[str, Any]:
    volumes: dict[str, Any] = {"dodo-channel": {"driver_opts": {**_IN_MEMORY, "o": "size=1m,mode=1777"}}, "report": {}}
    if not own_network:
        return {"volumes": volumes}
    volumes["tmp"] = {"driver_opts": {**_IN_MEMORY, "o": "nr_blocks=65536,mode=1777"}}  # Podman 4.3 refuses a size
    if plan.lockstep:
        volumes[TIME] = {}  # filled from the sandbox's image
    network: dict[str, Any] = {"ipam": {"config": [{"subnet": f"${{DODO_SUBNET:-{plan.subnet}}}"}]}}
    if not plan.application.access.outside:  # no way to the host and to other networks
        network["driver_opts"] = {"com.docker.network.bridge.inhibit_ipv4": "true"}
    return {"networks": {"default": network}, "volumes": volumes}


def _sandbox(plan: Plan) -> dict[str, Any]:
    """It holds the shared memory of all others, and in lockstep gives the application the test's time.

    Then it is the first process of its namespace, so that no other of it can end it.
    """
    command = ["sleep", "infinity"]
    if plan.lockstep:
        command = [f"{TIME_MOUNT}/{TIME}", *agent_flags(plan.application.services, plan.seed)]
    return {
        "image": plan.sandbox_image,
        "command": command,
        "init": plan.lockstep is None,
        "ipc": "shareable",
        "shm_size": "256m",
        **_CONFINED,
        "stop_grace_period": "1s",
        "labels": {"dodo.test": plan.slug, "dodo.layer": SANDBOX},
        "volumes": ["tmp:/tmp", *([f"{TIME}:{TIME_MOUNT}"] if plan.lockstep else [])],
    }


def _files(plan: Plan) -> dict[str, Any]:
    volumes: list[dict[str, Any]] = []
    for name, source in plan.application.copies.items():
        volumes.append({**FILES_MOUNT, "source": source, "target": f"/from/{name}"})
        volumes.append({"type": "volume", "source": name, "target": f"/to/{name}", "volume": {"nocopy": True}})
    return {
        "image": plan.sandbox_image,
        "entrypoint": ["sh", "-c", copy_command(plan.application)],
        "user": "0:0",
        "network_mode": "none",
        "init": True,
        **_CONFINED,
        "cap_add": ["CHOWN", "DAC_OVERRIDE", "FOWNER", "FSETID"],
        "stop_grace_period": "1s",
        "labels": {"dodo.test": plan.slug, "dodo.layer": "files"},
        "tmpfs": ["/run"],
        "volumes": volumes,
        "healthcheck": _healthcheck(["test", "-f", "/run/copied"], 10 * READY_S),
    }


def _healthcheck(test: list[str], seconds: float) -> dict[str, Any]:
    tries = math.ceil(_TRIES_A_SECOND * seconds)
    return {"test": ["CMD", *test], "interval": "500ms", "timeout": "2s", "retries": tries}


def _service(plan: Plan, service: PlannedService) -> dict[str, Any]:
    environment = {"<<": Alias("environment"), "DODO_SERVICE": service.name}
    if service.name == CLOCK:
        environment[RUNNER_VARIABLE] = f"${{{RUNNER_VARIABLE}:-}}"
        environment[ANSWERS_VARIABLE] = "1" if plan.isolation == "host" else f"${{{ANSWERS_VARIABLE}:-}}"
    made: dict[str, Any] = {
        "<<": Alias("service"),
        "image": service.image,
        "command": [_word(flag) for flag in service.flags],
        "environment": environment,
        "healthcheck": _healthcheck(["test", "-L", f"{CHANNEL}/{service.name}"], READY_S + service.setup_s),
    }
    if service.devices:
        made |= {"devices": list(service.devices), "group_add": ["dialout" if service.port else "video"]}
    if len(volumes := _volumes(plan, service)) > len(_common(plan)):
        made["volumes"] = volumes
    return made


def _word(flag: Flag) -> str:
    """``--name=value`` with container paths, with ``$`` doubled for compose."""
    folder = {"path": f"{FILES}/", "report": f"{REPORT}/"}.get(flag.kind, "")
    return f"--{flag.name}={folder}{flag.value}".replace("$", "$$")


def _common(plan: Plan) -> list[Any]:
    return ["tmp:/tmp" if plan.isolation == "network" else "/tmp:/tmp", f"dodo-channel:{CHANNEL}"]


def _volumes(plan: Plan, service: PlannedService) -> list[Any]:
    """With the shared files to which the service's own paths lead, at the position to which the test's links lead."""
    paths = {*plan.messages, *(flag.value for flag in service.flags if flag.kind == "path")}
    shared = {name for target, name in plan.shared.items() if any(f"{target}/".startswith(f"{p}/") for p in paths)}
    files = [{**FILES_MOUNT, "source": f"../{SHARED}/{n}", "target": f"/{SHARED}/{n}"} for n in sorted(shared)]
    report = [f"report:{REPORT}"] if any(flag.kind == "report" for flag in service.flags) else []
    return [*_common(plan), *([FILES_MOUNT, *files] if paths else []), *report]


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
