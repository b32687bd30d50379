"""What an application's containers mount of the host, and what lies over it: tests are hidden, nothing is made."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dodo_dsl.application.host_paths import HostPaths
from dodo_dsl.application.interpolation import escaped
from dodo_dsl.application.merge import is_path


@dataclass(frozen=True)
class Bind:
    """A file or folder of the host in a container; the engine makes it, unless it ``is_required`` to be there."""

    source: str
    target: str
    is_required: bool = False


def whole(path: str, folder: Path) -> str:
    """A path of a test compiled into ``folder``, as compose passes it on; links stay."""
    return os.path.normpath(folder / os.path.expanduser(path.replace("$$", "$")))  # noqa: PTH111  (it never raises)


def binds(service: Mapping[str, Any], folder: Path) -> Iterator[Bind]:
    """What a service of a test compiled into ``folder`` mounts."""
    for mount in service.get("volumes") or ():
        if isinstance(mount, dict):
            source, kind = str(mount.get("source", "")), mount["type"]
            is_required = not mount.get("bind", {}).get("create_host_path")
        else:
            source, sign, _ = mount.partition(":")
            kind, is_required = ("bind" if sign and is_path(source) else "volume"), False
        if kind == "bind":
            yield Bind(whole(source, folder), target_of(mount), is_required)


def target_of(mount: str | Mapping[str, Any]) -> str:
    if isinstance(mount, str):
        parts = mount.split(":")
        return (parts[1] if len(parts) > 1 else mount).replace("$$", "$")
    return str(mount.get("target", "")).replace("$$", "$")


def over(mounts: Sequence[Any], masks: Sequence[Mapping[str, Any]]) -> list[Any]:
    """The mounts of a service with ``masks``, each in the place of what is mounted there."""
    targets = {target_of(mask) for mask in masks}
    return [*(mount for mount in mounts if target_of(mount) not in targets), *masks]


def long_form(mount: str | Mapping[str, Any], folder: Path) -> str | Mapping[str, Any]:
    """A mount of what is there in the form in which its path may have a colon, and the engine makes nothing."""
    made: Mapping[str, Any] = {} if isinstance(mount, str) else mount
    if isinstance(mount, str):
        source, _, rest = mount.partition(":")
        target, _, options = rest.partition(":")
        if not is_path(source) or not rest or options not in ("", "ro"):
            return mount
        made = {"type": "bind", "source": source, "target": target, "read_only": options == "ro"}
    if made["type"] != "bind" or not os.path.lexists(whole(made["source"], folder)):
        return mount
    return {**made, "bind": {"create_host_path": False}}


def masks(mounted: Sequence[Bind], hidden: Sequence[Path], empty: Path) -> list[dict[str, Any]]:
    """Mounts that hide files and folders; the file that is ``empty`` takes the place of files."""
    targets: dict[Path, bool] = {}
    for bind in mounted:
        source = Path(os.path.realpath(bind.source))
        for path in hidden:
            if source.is_relative_to(path):
                targets[Path(bind.target)] = path.is_file()
            elif path.is_relative_to(source):
                targets[Path(bind.target, path.relative_to(source))] = path.is_file()
    outer = {target: is_file for target, is_file in targets.items() if targets.keys().isdisjoint(target.parents)}
    kinds = {True: {"type": "bind", "source": escaped(str(empty))}, False: {"type": "tmpfs"}}
    return [{**kinds[is_file], "target": escaped(str(target)), "read_only": True} for target, is_file in outer.items()]


def absent(mounted: Sequence[Bind], paths: HostPaths, always: bool = False) -> list[dict[str, Any]]:
    """Empty folders in the place of what is mounted and not there: the engine would make it, as root.

    What dodo.yml lets an application write to is the host's own, and made as always; without ``always``, the engine
    refuses what it must not make.
    """
    gone = [b for b in mounted if not os.path.lexists(b.source) and not paths.is_writable(b.source)]
    made = [bind for bind in gone if always or not bind.is_required]
    return [{"type": "tmpfs", "target": escaped(bind.target), "read_only": True} for bind in made]
