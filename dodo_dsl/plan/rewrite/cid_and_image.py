"""A service's CID, by flag or by variable, and its image."""

from typing import Any

from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.model import text
from dodo_dsl.application.service_environment import image_variable
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy


def assign_image(copy: ServiceCopy) -> None:
    """The image of the file, unless a pipeline sets another one."""
    service, variable = copy.service, image_variable(copy.name)
    if service.get("image") is None and "build" not in service:
        return
    service["image"] = f"${{{variable}:-{service.get('image') or ''}}}"
    copy.note(f"image from {variable}, where it is set")


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
