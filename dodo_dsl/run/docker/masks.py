"""Empty folders over what an application's mounts would show of the tests: their files, results and history."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl.application.access.host_paths import HostPaths


def masks(service: Mapping[str, Any], volumes: Mapping[str, Any], hidden: Sequence[Path]) -> list[dict[str, Any]]:
    """The mounts that hide them, as ``docker compose config`` shows the service and the file's ``volumes``."""
    targets = list(dict.fromkeys(map(Path, _targets(service, volumes, hidden))))
    outer = [target for target in targets if not any(parent in targets for parent in target.parents)]
    return [{"type": "tmpfs", "target": str(target), "read_only": True} for target in outer]


def absent(service: Mapping[str, Any], paths: HostPaths, always: bool = False) -> list[dict[str, Any]]:
    """Empty folders in the place of what is mounted and not there: the engine would make it, as root.

    What dodo.yml lets an application write to is the host's own, and made as always; without ``always``, the engine
    refuses what it is told not to make.
    """
    binds = [volume for volume in service.get("volumes") or () if volume.get("type") == "bind"]
    gone = [v for v in binds if not os.path.lexists(v["source"]) and not paths.is_writable(v["source"])]
    made = [v for v in gone if always or v.get("bind", {}).get("create_host_path")]
    return [{"type": "tmpfs", "target": volume["target"], "read_only": True} for volume in made]


def _targets(service: Mapping[str, Any], volumes: Mapping[str, Any], hidden: Sequence[Path]) -> Iterator[str]:
    for volume in service.get("volumes") or ():
        source = _source(volume, volumes)
        if source is None:
            continue
        for path in hidden:
            if source == path or source.is_relative_to(path):
                yield volume["target"]
            elif path.is_relative_to(source):
                yield str(Path(volume["target"], path.relative_to(source)))


def _source(volume: Mapping[str, Any], volumes: Mapping[str, Any]) -> Path | None:
    """The folder of the host that a mount shows, if it does."""
    source = volume.get("source")
    if volume.get("type") == "volume":
        options = (volumes.get(str(source)) or {}).get("driver_opts") or {}
        source = options.get("device") if "bind" in str(options.get("o", "")) else None
    elif volume.get("type") != "bind":
        return None
    return Path(os.path.realpath(source)) if source else None
