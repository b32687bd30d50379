"""One service of the copy: its content, the properties of its test, and the changes made."""

from collections.abc import Mapping, MutableSequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dodo_dsl.application.access.model import Look
from dodo_dsl.application.interpolation import interpolated
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

if TYPE_CHECKING:
    from dodo_dsl.plan.rewrite.volumes import FileCopies


@dataclass(frozen=True)
class Setting:
    """What a test's copy of the application depends on; ``folder`` is the compiled test's.

    ``waits`` are the services of DoDo after which the application starts. Devices stay only with ``hil``, privileges
    only with ``privileged_allowed`` as well. ``limits`` is what a service gets that sets none, and ``given`` are
    variables that the test sets.
    """

    cid: int
    isolation: str
    folder: Path
    waits: tuple[str, ...] = ()
    hil: bool = False
    privileged_allowed: bool = False
    limits: SandboxLimits = field(default_factory=SandboxLimits)
    given: tuple[tuple[str, str], ...] = ()

    @property
    def own_network(self) -> bool:
        return self.isolation == "network"

    @property
    def keeps_privileges(self) -> bool:
        return self.hil and self.privileged_allowed


@dataclass(frozen=True)
class Project:
    """What the services of one copy share: the ``names`` of those that start, and the variables that are ``known``.

    ``look`` judges what they may have, and ``copies`` are the folders of the repository that the test copies.
    """

    setting: Setting
    names: frozenset[str]
    look: Look
    known: Mapping[str, str] = field(default_factory=dict)
    copies: "FileCopies | None" = None


@dataclass(frozen=True)
class ServiceCopy:
    """A service that is changed in place."""

    name: str
    service: dict[str, Any]
    project: Project
    changes: MutableSequence[str]

    @property
    def setting(self) -> Setting:
        return self.project.setting

    def filled(self, value: Any) -> Any:
        """A value of the service with its variables filled in, as far as they are known."""
        return interpolated(value, self.project.known)

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
