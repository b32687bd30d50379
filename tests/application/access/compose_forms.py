"""Every form that compose's schema accepts for each key of the tables, with values that a test may have.

The forms are those of the schema: each branch of ``oneOf``, each type, each value of an ``enum``, each key of a
mapping, an item of a list, and keys that begin with ``x-``. Numbers and switches are also written as strings.
"""

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import check_jsonschema
import orjson

VENDORED = Path(check_jsonschema.__file__).parent / "builtin_schemas" / "vendor" / "compose-spec.json"
FILES = {"a.env": "A=1\n", "Dockerfile": "FROM scratch\n", "data/x": "", "other.yml": "services: {b: {image: x}}\n"}
"""What the values below name."""
_OF_MOUNT = "service.volumes.*"
_SOURCES: dict[str, dict[str, Any]] = {
    "volume": {"type": "volume", "source": "vol"},
    "tmpfs": {"type": "tmpfs", "source": ""},
    "image": {"type": "image", "source": "team/x"},
}
_SAMPLES: dict[str, tuple[Any, ...]] = {
    "config.file": ("./a.env",),
    "secret.file": ("./a.env",),
    "service.blkio_config.*.*.path": ("/dev/sda",),
    "service.blkio_config.*.*.rate": ("1mb", 1024),
    "service.blkio_config.weight": (10,),
    "service.blkio_config.weight_device.*.weight": (10,),
    "service.build": (".",),
    "service.build.additional_contexts.a": ("./data",),
    "service.build.additional_contexts.*": ("a=./data",),
    "service.build.cache_from.*": ("team/x:1", "type=registry,ref=team/x"),
    "service.build.cache_to.*": ("type=local,dest=/tmp/x",),
    "service.build.context": (".", "https://example.org/x.git#main:sub"),
    "service.build.dockerfile": ("Dockerfile",),
    "service.build.dockerfile_inline": ("FROM scratch",),
    "service.build.extra_hosts.a": ("10.0.0.1",),
    "service.build.extra_hosts.*": ("a:10.0.0.1",),
    "service.build.extra_hosts.a.*": ("10.0.0.1",),
    "service.build.network": ("default", "none"),
    "service.build.platforms.*": ("linux/amd64",),
    "service.build.secrets.*": ("s",),
    "service.build.secrets.*.source": ("s",),
    "service.build.shm_size": ("64m", 67108864),
    "service.build.ssh.*": ("default",),
    "service.build.tags.*": ("team/x:2",),
    "service.cap_add.*": ("SYS_NICE", "cap_sys_nice", "NET_ADMIN", "all", "ALL"),
    "service.cap_drop.*": ("ALL", "chown"),
    "service.configs.*": ("c",),
    "service.configs.*.source": ("c",),
    "service.container_name": ("name-of-a",),
    "service.cpu_count": (1,),
    "service.cpu_percent": (50,),
    "service.cpus": (0.5,),
    "service.cpuset": ("0",),
    "service.deploy.mode": ("replicated", "global"),
    "service.deploy.endpoint_mode": ("vip", "dnsrr"),
    "service.deploy.*.delay": ("1s",),
    "service.deploy.*.monitor": ("1s",),
    "service.deploy.*.failure_action": ("pause",),
    "service.deploy.*.max_failure_ratio": (0.5,),
    "service.deploy.restart_policy.condition": ("any",),
    "service.deploy.restart_policy.window": ("1s",),
    "service.deploy.resources.*.cpus": (0.5,),
    "service.deploy.resources.*.memory": ("64M",),
    "service.deploy.resources.reservations.devices.*.capabilities.*": ("gpu",),
    "service.deploy.resources.reservations.devices.*.count": (1, "all"),
    "service.deploy.resources.reservations.devices.*.device_ids.*": ("0",),
    "service.deploy.resources.reservations.devices.*.driver": ("nvidia",),
    "service.depends_on.*": ("b",),
    "service.develop.watch.*.path": ("./data",),
    "service.develop.watch.*.exec": ({"command": "x"},),
    "service.device_cgroup_rules.*": ("c 81:* rw",),
    "service.devices.*": ("/dev/ttyX0", "/dev/ttyX0:/dev/ttyX1:rw"),
    "service.devices.*.source": ("/dev/ttyX0",),
    "service.devices.*.permissions": ("rw",),
    "service.dns": ("10.0.0.1",),
    "service.dns.*": ("10.0.0.1",),
    "service.dns_opt.*": ("ndots:1",),
    "service.environment.a": ("1", 1, 1.5),
    "service.environment.*": ("A=1", "A", "A="),
    "service.env_file": ("a.env",),
    "service.env_file.*": ("a.env",),
    "service.env_file.*.path": ("a.env",),
    "service.env_file.*.format": ("raw",),
    "service.expose.*": (80, "80-81/udp"),
    "service.extends": ("b",),
    "service.extends.service": ("b",),
    "service.extends.file": ("other.yml",),
    "service.external_links.*": ("redis",),
    "service.extra_hosts.a": ("10.0.0.1",),
    "service.extra_hosts.*": ("a:10.0.0.1", "a=10.0.0.1"),
    "service.extra_hosts.a.*": ("10.0.0.1",),
    "service.gpus.*.capabilities.*": ("gpu",),
    "service.gpus.*.count": (1, "all"),
    "service.gpus.*.device_ids.*": ("0",),
    "service.gpus.*.driver": ("nvidia",),
    "service.group_add.*": ("video", 44),
    "service.healthcheck.interval": ("1m30s",),
    "service.healthcheck.start_interval": ("1s",),
    "service.healthcheck.start_period": ("1s",),
    "service.healthcheck.test.*": ("NONE",),
    "service.healthcheck.timeout": ("1s",),
    "service.ipc": ("host", "shareable", "private", "none", "service:b"),
    "service.label_file": ("a.env",),
    "service.label_file.*": ("a.env",),
    "service.labels.a": ("x", 1),
    "service.labels.*": ("a=b", "a"),
    "service.links.*": ("b", "b:other"),
    "service.logging.driver": ("json-file", "local", "syslog", "JSON-FILE"),
    "service.logging.options.a": ("1",),
    "service.mac_address": ("02:42:ac:11:00:02",),
    "service.mem_limit": ("64m", 67108864, "64M", "64MB"),
    "service.mem_reservation": ("32m", 33554432),
    "service.memswap_limit": ("64m", 67108864, -1),
    "service.network_mode": ("host", "bridge", "none", "service:b", "own"),
    "service.networks.*": ("n",),
    "service.networks.a.ipv4_address": ("10.0.0.2",),
    "service.networks.a.ipv6_address": ("fd00::2",),
    "service.networks.a.link_local_ips.*": ("169.254.0.1",),
    "service.networks.a.mac_address": ("02:42:ac:11:00:02",),
    "service.oom_score_adj": (-500,),
    "service.pid": ("service:b",),
    "service.platform": ("linux/amd64",),
    "service.ports.*": (80, "80", "127.0.0.1:80:80/udp", "8000-8001:80-81"),
    "service.ports.*.mode": ("host",),
    "service.ports.*.protocol": ("udp",),
    "service.ports.*.host_ip": ("127.0.0.1",),
    "service.ports.*.target": (80,),
    "service.ports.*.published": (80,),
    "service.pull_policy": ("always", "every_1d"),
    "service.pull_refresh_after": ("1d",),
    "service.restart": ("no", "always", "on-failure:3", "unless-stopped"),
    "service.runtime": ("runc",),
    "service.scale": (1, 2),
    "service.secrets.*": ("s",),
    "service.secrets.*.source": ("s",),
    "service.security_opt.*": ("no-new-privileges:true", "seccomp:unconfined", "label=disable", "APPARMOR=unconfined"),
    "service.shm_size": ("64m", 67108864),
    "service.stop_grace_period": ("1s",),
    "service.stop_signal": ("SIGINT", "sigint", "2"),
    "service.sysctls.a": (65536,),
    "service.sysctls.*": ("kernel.msgmax=65536",),
    "service.tmpfs": ("/run", "/run:size=64m,mode=755"),
    "service.tmpfs.*": ("/run",),
    "service.ulimits.a": (1024,),
    "service.user": ("1000:1000", "root"),
    "service.userns_mode": ("host",),
    "service.uts": ("host",),
    "service.volumes.*": (
        "./data:/d", "./data:/d:ro", "./data:/d:ro,rw", "./data:/d:Z", "/usr/share:/d", "vol:/d", "vol:/d:nocopy", "/d",
        "/tmp:/tmp", "/dev/shm:/dev/shm",
    ),
    "service.volumes.*.source": ("./data", "/usr/share"),
    "service.volumes.*.target": ("/d",),
    "service.volumes.*.bind.propagation": ("rprivate", "private"),
    "service.volumes.*.tmpfs.size": ("64m", 67108864),
    "service.volumes.*.tmpfs.mode": (0o755,),
    "service.volumes.*.consistency": ("cached",),
    "service.volumes_from.*": ("b", "b:ro"),
    "service.working_dir": ("/x",),
    "service.credential_spec.file": ("./a.env",),
    "volume.driver": ("local",),
    "volume.driver_opts.a": ("x",),
}  # fmt: skip
"""Values of keys that take not just any: by the path of the value, where ``*`` also stands for any step."""
_NAMES = {
    "service.depends_on": "b",
    "service.networks": "n",
    "service.sysctls": "kernel.msgmax",
    "service.ulimits": "nofile",
    "service.build.ulimits": "nofile",
    "service.logging.options": "max-file",
}
"""Names in mappings that take not just any."""
_WITH = {
    "service.volumes.*": {"source": "./data", "target": "/d"},
    "service.devices.*": {"source": "/dev/ttyX0", "target": "/dev/ttyX0"},
    "service.configs.*": {"source": "c"},
    "service.secrets.*": {"source": "s"},
    "service.build.secrets.*": {"source": "s"},
    "service.build": {"context": "."},
    "service.extends": {"service": "b"},
    "service.ports.*": {"target": 80},
    "service.gpus.*": {"capabilities": ["gpu"]},
}
"""Keys without which a mapping says nothing."""


@functools.cache
def schema() -> dict[str, Any]:
    """Compose's schema."""
    read: dict[str, Any] = orjson.loads(VENDORED.read_bytes())
    return read


@dataclass(frozen=True)
class Form:
    """A ``value`` of a key; ``label`` says how it is written."""

    label: str
    value: Any


def forms(node: Any, path: str) -> Iterator[Form]:
    """The forms of what a node of the schema describes, which is at ``path``."""
    node = resolved(node)
    if "enum" in node:
        yield from (Form(str(value), value) for value in node["enum"])
    elif branches := node.get("oneOf") or node.get("anyOf"):
        for branch in branches:
            yield from forms(branch, path)
    else:
        types = node.get("type", "object")
        types = [types] if isinstance(types, str) else types
        for kind in types:
            yield from _of_type(kind, types, node, path)


def resolved(node: Any) -> Any:
    """The node itself, or the definition that it names."""
    name = node.get("$ref", "").rpartition("/")[2] if isinstance(node, dict) else ""
    return schema()["$defs"][name] if name else node


def _of_type(kind: str, types: list[str], node: Any, path: str) -> Iterator[Form]:
    own = _samples(path)
    if kind == "null":
        yield Form("null", None)
    elif kind == "boolean":
        yield from (Form(str(value).lower(), value) for value in (True, False))
    elif kind in ("number", "integer"):
        numbers = [value for value in own if not isinstance(value, str)] or ([] if own else [1])
        yield from (Form(f"number {value}", value) for value in numbers)
    elif kind == "string":
        yield from (Form(f"string '{value}'", value) for value in _strings(own, types))
    elif kind == "array":
        yield from (Form(f"list of {f.label}", [f.value]) for f in forms(node["items"], f"{path}.*"))
    else:
        yield from _mappings(node, path)


def _strings(own: tuple[Any, ...], types: list[str]) -> Iterator[str]:
    if "boolean" in types and not {"number", "integer"} & set(types):
        yield from ("true", "TRUE", "yes", "false")
        return
    numbers = own or ((1,) if {"number", "integer"} & set(types) else ("x",))
    yield from dict.fromkeys(str(value) for value in numbers)


def _mappings(node: Any, path: str) -> Iterator[Form]:
    """Mappings with one key more than they need, in each of its forms."""
    properties = dict(node.get("properties", {}))
    needed = {key: next(forms(properties[key], f"{path}.{key}")).value for key in node.get("required", ())}
    needed.update(_fixed(path))
    for key, inner in properties.items():
        for form in forms(inner, f"{path}.{key}"):
            yield Form(f"{key}: {form.label}", {**needed, **_of_kind(path, key, form.value), key: form.value})
    for pattern, inner in node.get("patternProperties", {}).items():
        if pattern == "^x-":
            yield Form("x-own", {**needed, "x-own": "x"})
            continue
        name = _NAMES.get(path, "a")
        for form in forms(inner, f"{path}.a"):
            yield Form(f"{name}: {form.label}", {name: form.value})
    if not properties and "patternProperties" not in node:
        yield Form("mapping", {"a": "x"})


def _of_kind(path: str, key: str, value: Any) -> dict[str, Any]:
    """What else a mount needs whose ``type``, or whose options, are not those of a folder."""
    kind = value if key == "type" else key
    return _SOURCES.get(kind, {}) if path == _OF_MOUNT else {}


def _samples(path: str) -> tuple[Any, ...]:
    return next((values for name, values in _SAMPLES.items() if _fits(name, path)), ())


def _fixed(path: str) -> dict[str, Any]:
    return next((values for name, values in _WITH.items() if _fits(name, path)), {})


def _fits(name: str, path: str) -> bool:
    want, have = name.split("."), path.split(".")
    return len(want) == len(have) and all(w in ("*", h) for w, h in zip(want, have, strict=True))
