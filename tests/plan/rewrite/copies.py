"""Copies of services for tests."""

from typing import Any

from dodo_dsl.plan.rewrite.file_copies import FileCopies
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy, Setting
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

CONFINED: dict[str, Any] = {
    "pids_limit": 1024,
    "mem_limit": 2_000_000_000,
    "ulimits": {"core": 0, "fsize": 1_000_000_000, "nofile": 1024},
    "cap_drop": ["AUDIT_WRITE", "MKNOD", "NET_RAW", "SETFCAP", "SYS_CHROOT"],
    "security_opt": ["no-new-privileges:true"],
    "logging": {"driver": "json-file", "options": {"max-size": "50m", "max-file": "2"}},
}
"""What confines a service that sets nothing."""


def copy(
    service: dict[str, Any],
    *,
    isolation: str = "network",
    hil: bool = False,
    privileged: bool = False,
    ports: tuple[str, ...] = (),
    limits: SandboxLimits = SandboxLimits(),  # noqa: B008  (it is frozen)
    copies: FileCopies | None = None,
) -> ServiceCopy:
    """A service beside ``eyes``, whose container is ``camera``."""
    names, containers = frozenset(["a", "eyes"]), {"camera": "eyes"}
    setting = Setting(140, isolation, ("judge",), names, containers, hil, privileged, {}, limits, ports, copies)
    return ServiceCopy("a", service, setting, [])
