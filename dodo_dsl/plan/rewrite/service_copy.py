"""One service of the copy: its content, the properties of its test, and the changes made."""

from collections.abc import Mapping, MutableSequence
from dataclasses import dataclass, field
from typing import Any

from dodo_dsl.application.access import filled
from dodo_dsl.plan.rewrite.file_copies import FileCopies
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits


@dataclass(frozen=True)
class Setting:
    """Properties of a test; ``waits`` are the services of DoDo after which the application starts.

    ``names`` are the application's services that start, ``containers`` their names by ``container_name``, ``known`` the
    variables whose values are known, ``limits`` what a service gets that sets none, ``ports`` those of rigs, and
    ``copies`` the folders of the repository that the test copies.
    """

    cid: int
    isolation: str
    waits: tuple[str, ...]
    names: frozenset[str]
    containers: Mapping[str, str]
    hil: bool = False
    privileged_allowed: bool = False
    known: Mapping[str, str] = field(default_factory=dict)
    limits: SandboxLimits = field(default_factory=SandboxLimits)
    ports: tuple[str, ...] = ()
    copies: FileCopies | None = None

    @property
    def own_network(self) -> bool:
        return self.isolation == "network"

    @property
    def keeps_privileges(self) -> bool:
        return self.hil and self.privileged_allowed


@dataclass(frozen=True)
class ServiceCopy:
    """A service that is changed in place."""

    name: str
    service: dict[str, Any]
    setting: Setting
    changes: MutableSequence[str]

    def filled(self, value: Any) -> Any:
        """A value of the service with its variables filled in, as far as they are known."""
        return filled.value(value, self.setting.known)

    def note(self, change: str) -> None:
        line = "".join(c if c.isprintable() else "?" for c in f"{self.name}: {change}")
        self.changes.append(line if len(line) <= 200 else line[:197] + "...")

    def remove(self, key: str, why: str = "") -> Any:
        """Removes a key, and notes that."""
        value = self.service.pop(key, None)
        if value is not None:
            self.note(f"{key} removed{', ' if why else ''}{why}")
        return value

    def keep_items(self, key: str, items: list[Any]) -> None:
        """Sets a key to the items that remain, or removes it when none do."""
        if items:
            self.service[key] = items
        else:
            self.service.pop(key, None)
