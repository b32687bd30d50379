"""The keys below those of a service: what a misspelt one limits or waits for, it does not."""

from collections.abc import Iterator
from typing import Any

from dodo_dsl.application.access.compose_keys import BELOW
from dodo_dsl.application.access.model import AccessFinding, Steps, key_findings
from dodo_dsl.diagnostics import did_you_mean, only_fix

_FILE = "source target uid gid mode"
_RATE = "path rate"
_DEVICE = "driver count device_ids capabilities options"
_UPDATE = "parallelism delay failure_action monitor max_failure_ratio order"
_KEYS = {
    "blkio_config": "device_read_bps device_read_iops device_write_bps device_write_iops weight weight_device",
    "blkio_config.device_read_bps.*": _RATE,
    "blkio_config.device_read_iops.*": _RATE,
    "blkio_config.device_write_bps.*": _RATE,
    "blkio_config.device_write_iops.*": _RATE,
    "blkio_config.weight_device.*": "path weight",
    "build.secrets.*": _FILE,
    "build.ulimits.*": "soft hard",
    "configs.*": _FILE,
    "credential_spec": "config file registry",
    "depends_on.*": "condition restart required",
    "deploy.placement": "constraints preferences max_replicas_per_node",
    "deploy.placement.preferences.*": "spread",
    "deploy.resources": "limits reservations",
    "deploy.resources.limits": "cpus memory pids",
    "deploy.resources.reservations.devices.*": _DEVICE,
    "deploy.resources.reservations.generic_resources.*": "discrete_resource_spec",
    "deploy.resources.reservations.generic_resources.*.discrete_resource_spec": "kind value",
    "deploy.restart_policy": "condition delay max_attempts window",
    "deploy.rollback_config": _UPDATE,
    "deploy.update_config": _UPDATE,
    "devices.*": "source target permissions",
    "env_file.*": "path format required",
    "gpus.*": _DEVICE,
    "healthcheck": "disable interval retries test timeout start_period start_interval",
    "logging": "driver options",
    "networks.*": "aliases interface_name ipv4_address ipv6_address link_local_ips mac_address driver_opts priority"
    " gw_priority use_service_name_alias",
    "ports.*": "name mode host_ip target published protocol app_protocol",
    "secrets.*": _FILE,
    "ulimits.*": "soft hard",
    "volumes.*.bind": "propagation create_host_path recursive selinux",
    "volumes.*.image": "subpath",
    "volumes.*.tmpfs": "size mode",
}
_ELSEWHERE = ("build", "volumes.*")
"""Mappings that are judged with what they hold."""
NESTED = {path: tuple(keys.split()) for path, keys in _KEYS.items()} | {
    path: tuple(rows) for path, rows in BELOW.items() if path not in _ELSEWHERE
}
"""The keys of each mapping in a service by its path; ``*`` is an item of a list, or a name."""


def nested_findings(name: str, service: dict[str, Any], compiled: bool = False) -> Iterator[AccessFinding]:
    """Unknown keys below those of a service, which messages call ``name``.

    Of a ``compiled`` one compose shows those of ``blkio_config`` in capitals.
    """
    for path, known in NESTED.items():
        for steps, value in mappings(service, path):
            for key in value:
                seen = str(key).lower() if compiled and path.startswith("blkio_config.") else str(key)
                if seen not in known and not str(key).startswith("x-"):
                    hint, fix = did_you_mean(str(key), known), only_fix(str(key), known, value)
                    place = ".".join(str(step) for step in steps if isinstance(step, str))
                    yield AccessFinding(
                        (*steps, key), f"unknown key '{key}' in '{place}' of '{name}'", hint, "unknown", fix
                    )


def removed_findings(name: str, service: dict[str, Any]) -> Iterator[AccessFinding]:
    """Keys below those of a compiled service that no copy has."""
    for path, rows in BELOW.items():
        for steps, value in mappings(service, path):
            known = {key: about for key, about in value.items() if key in rows}
            what = f"'{path.removesuffix('.*')}' of '{name}'"
            yield from (f.below(*steps) for f in key_findings(what, rows, known, compiled=True))


def mappings(service: dict[str, Any], path: str) -> Iterator[tuple[Steps, dict[str, Any]]]:
    """The mappings at a path, with the steps that lead to them."""
    yield from _found(service, path.split("."))


def _found(value: Any, path: list[str], steps: Steps = ()) -> Iterator[tuple[Steps, dict[str, Any]]]:
    if not path:
        if isinstance(value, dict):
            yield steps, value
        return
    below: list[tuple[str | int, Any]] = []
    if path[0] == "*":
        below = list(enumerate(value)) if isinstance(value, list) else list(_items(value))
    elif isinstance(value, dict) and path[0] in value:
        below = [(path[0], value[path[0]])]
    for step, inner in below:
        yield from _found(inner, path[1:], (*steps, step))


def _items(value: Any) -> Iterator[tuple[str | int, Any]]:
    yield from value.items() if isinstance(value, dict) else ()
