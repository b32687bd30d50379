"""One service of the copy: its content, its CID and image, the properties of its test, and the changes made.

The CID is set by flag or by variable.
"""

from collections.abc import Collection, Mapping, MutableSequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.access.model import Look
from dodo_dsl.application.interpolation import interpolated
from dodo_dsl.application.model import image_variable, text
from dodo_dsl.plan.model import OFFSCREEN
from dodo_dsl.spec.sandbox_limits import SandboxLimits

if TYPE_CHECKING:
    from dodo_dsl.plan.rewrite.volumes import FileCopies

_DISPLAY = "DISPLAY"


@dataclass(frozen=True)
class Setting:
    """What a test's copy of the application depends on; ``folder`` is the compiled test's.

    ``waits`` are the services of DoDo after which the application starts. Devices stay only with ``hil``, privileges
    only with ``privileged_allowed`` as well. ``limits`` is what a service gets that sets none, and ``given`` are
    variables that the test sets. With a ``time_seed``, the application's own time is the test's.
    """

    cid: int
    isolation: str
    folder: Path
    waits: tuple[str, ...] = ()
    hil: bool = False
    privileged_allowed: bool = False
    limits: SandboxLimits = field(default_factory=SandboxLimits)
    given: tuple[tuple[str, str], ...] = ()
    time_seed: int | None = None

    @property
    def own_network(self) -> bool:
        return self.isolation == "network"

    @property
    def keeps_privileges(self) -> bool:
        return self.hil and self.privileged_allowed


@dataclass(frozen=True)
class ComposeProject:
    """What the services of one copy share: the ``names`` of those that start, in order.

    ``known`` are the variables that are known, ``look`` judges what they may have, and ``copies`` are the folders of
    the repository that the test copies.
    """

    setting: Setting
    names: Collection[str]
    look: Look
    known: Mapping[str, str] = field(default_factory=dict)
    copies: "FileCopies | None" = None


@dataclass(frozen=True)
class ServiceCopy:
    """A service that is changed in place."""

    name: str
    service: dict[str, Any]
    project: ComposeProject
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


def assign_image(copy: ServiceCopy) -> None:
    """The image of the file, unless a pipeline sets another one."""
    service, variable = copy.service, image_variable(copy.name)
    if service.get("image") is None and "build" not in service:
        return
    service["image"] = f"${{{variable}:-{service.get('image') or ''}}}"
    copy.note(f"image from {variable}, where it is set")


def draw_nowhere(copy: ServiceCopy) -> None:
    """Qt draws offscreen where the file names a display, which a test has only if ``dodo.yml`` passes it."""
    raw = copy.service.get("environment") or {}
    names = {str(item).partition("=")[0] for item in raw}
    (variable, value), *_ = OFFSCREEN.items()
    if _DISPLAY not in names or variable in names or _DISPLAY in copy.project.look.passed:
        return
    copy.service["environment"] = [*raw, f"{variable}={value}"] if isinstance(raw, list) else {**raw, variable: value}
    copy.note(f"environment: {variable}={value}, as a test has no display")


def assign_cid(copy: ServiceCopy, in_files: tuple[str, ...]) -> None:
    """The CID wherever one was written, and in place of the one that ``env_file`` would set."""
    service, cid, assigned = copy.service, copy.setting.cid, []
    for key in ("entrypoint", "command"):
        before = service.get(key)
        if before is not None:
            service[key] = after = _command(before, cid)
            assigned.extend([f"{key}: --cid={cid}"] if opendlv_flags.takes_cid(_words(after), {}) else [])
    check = service.get("healthcheck")
    if isinstance(check, dict) and check.get("test") is not None:
        service["healthcheck"] = {**check, "test": _command(check["test"], cid)}
    assigned.extend(_assign_environment(service, cid, in_files))
    for change in assigned:
        copy.note(change)


def _command(command: Any, cid: int) -> Any:
    """A command with its CID, a string staying a string, which compose splits after it substitutes variables."""
    if isinstance(command, str):
        return opendlv_flags.with_cid_text(command, cid)
    before = [text(word) for word in command]
    return list(opendlv_flags.with_cid(before, cid))


def _words(command: Any) -> list[str]:
    return [command] if isinstance(command, str) else command


def _assign_environment(service: dict[str, Any], cid: int, in_files: tuple[str, ...]) -> list[str]:
    """Changes ``environment``, which keeps its form, and returns the assignments."""
    raw = service.get("environment") or {}
    if isinstance(raw, list):
        pairs: dict[str, Any] = {str(item).partition("=")[0]: str(item) for item in raw}
        changed: Any = {name: _pair(name, item, cid) for name, item in pairs.items()}
        changed.update({name: f"{name}={cid}" for name in in_files})
    else:
        pairs = raw
        changed = {name: _value(str(name), value, cid) for name, value in raw.items()}
        changed.update({name: str(cid) for name in in_files})
    if changed == pairs:
        return []
    service["environment"] = list(changed.values()) if isinstance(raw, list) else changed
    return [
        f"environment: {f'{name}={cid}' if name in opendlv_flags.CID_VARIABLES else f'--cid={cid} in {name}'}"
        for name, value in changed.items()
        if pairs.get(name) != value
    ]


def _pair(name: str, item: str, cid: int) -> str:
    return f"{name}={cid}" if name in opendlv_flags.CID_VARIABLES else opendlv_flags.with_cid_text(item, cid)


def _value(name: str, value: Any, cid: int) -> Any:
    if name in opendlv_flags.CID_VARIABLES:
        return str(cid)
    return opendlv_flags.with_cid_text(value, cid) if isinstance(value, str) else value
