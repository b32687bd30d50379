"""Copies of services for tests."""

from pathlib import Path
from typing import Any

from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.model import Look
from dodo_dsl.plan.rewrite.service_copy import ComposeProject, ServiceCopy, Setting
from dodo_dsl.plan.rewrite.volumes import FileCopies
from dodo_dsl.spec.sandbox_limits import SandboxLimits

FOLDER = Path("/builds/team")
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
    setting = Setting(140, isolation, FOLDER, ("judge",), hil, privileged, limits)
    return ServiceCopy("a", service, project(setting, ports, copies), [])


def project(setting: Setting, ports: tuple[str, ...] = (), copies: FileCopies | None = None) -> ComposeProject:
    look = Look(HostPaths(FOLDER, (FOLDER,)), containers={"camera": "eyes"}, ports=ports, limits=setting.limits)
    return ComposeProject(setting, frozenset(["a", "eyes"]), look, {}, copies)
