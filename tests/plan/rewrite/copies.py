"""Copies of services for tests."""

from typing import Any

from dodo_dsl.plan.rewrite.service_copy import ServiceCopy, Setting


def copy(
    service: dict[str, Any], *, isolation: str = "network", hil: bool = False, privileged: bool = False
) -> ServiceCopy:
    """A service beside ``eyes``, whose container is ``camera``."""
    names, containers = frozenset(["a", "eyes"]), {"camera": "eyes"}
    return ServiceCopy("a", service, Setting(140, isolation, ("judge",), names, containers, hil, privileged), [])
