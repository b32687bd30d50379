"""What a test's containers mount: files of the repository to be read, copies of its folders, the test's own volumes."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dodo_dsl.application.host_paths import MEMORY, NUL, TMP, is_port, is_token
from dodo_dsl.application.interpolation import escaped
from dodo_dsl.application.limits import capped, is_kept, size
from dodo_dsl.application.merge import is_path
from dodo_dsl.application.model import is_true, plain
from dodo_dsl.diagnostics import Span, did_you_mean
from dodo_dsl.source import Mapping, Node, Scalar

if TYPE_CHECKING:
    from dodo_dsl.application.construction import Construction
    from dodo_dsl.application.container import Container

OWN_VOLUMES = ("tmp", "report", "dodo-channel", "dodo-time")
"""The names of DoDo's own volumes in a test; an application's volumes of these names get others."""
COPY = "files-"
"""How the volumes of copies begin, each with a number."""
_OF_COPY = re.compile(rf"{COPY}\d+")


@dataclass(frozen=True)
class Mount:
    """An entry of ``volumes``, whose ``source`` is a path, a volume's name, or empty; ``span`` is the source's place.

    ``memory`` are the options of a file system in memory. What ``is_own`` is a path that ``Construction`` settles.
    """

    kind: str
    source: str
    target: str
    span: Span
    read_only: bool = False
    is_required: bool = False
    nocopy: bool = False
    memory: tuple[tuple[str, Any], ...] = ()
    is_own: bool = False

    def written(self) -> str | dict[str, Any]:
        source, target = escaped(self.source), escaped(self.target)
        words = [*(["ro"] if self.read_only else []), *(["nocopy"] if self.nocopy else [])]
        if ":" not in f"{source}{target}" and len(source) != 1 and not self.is_required and self.kind != "tmpfs":
            return ":".join(filter(None, (source, target, ",".join(words))))
        about = {"tmpfs": dict(self.memory), "bind": {"create_host_path": not self.is_required}}.get(self.kind, {})
        about |= {"nocopy": True} if self.nocopy else {}
        made: dict[str, Any] = {"type": self.kind, "source": source, "target": target}
        made |= {"read_only": True} if self.read_only else {}
        return {key: value for key, value in {**made, self.kind: about}.items() if value not in ("", {})}


def own_name(name: str) -> str:
    """The name of an application's volume in the test's project, where DoDo has its own volumes."""
    return f"application-{name}" if name in OWN_VOLUMES or _OF_COPY.fullmatch(name) else name


def mounts(of: "Container", node: Node) -> list[Mount]:
    read = [_read(of, item) for item in of.items(node) if isinstance(item, Mapping)]
    return [mount for each in read if each and (mount := _carried(of, each))]


def _read(of: "Container", item: Mapping) -> Mount | None:
    """A mount in its long form; None, with a problem, for one that is none."""
    own = of.fields(item, "a mount", "type source target read_only bind volume tmpfs", "consistency image")
    texts = {key: of.literal(node) for key, node in own.items() if isinstance(node, Scalar)}
    if None in texts.values():
        return None
    bind = of.fields(own.get("bind"), "'bind' of a mount", "create_host_path", "propagation recursive selinux")
    volume = of.fields(own.get("volume"), "'volume' of a mount", "nocopy", "labels subpath")
    kind, source, target = (texts.get(key) or "" for key in ("type", "source", "target"))
    span = own["source"].span if "source" in own else item.span
    if kind not in ("", "bind", "volume", "tmpfs"):
        of.refuse(own["type"].span, f"mounts of type '{kind}' cannot be isolated", "use a folder or a volume")
    elif "source" in own and not source and kind in ("", "volume"):
        of.bad(span, f"a mount of '{of.name}' has no source", "name a folder or a volume")
    elif not target:
        of.bad(span, f"a mount of '{of.name}' has no target", "name its folder in the container")
    else:
        required = bind.get("create_host_path")
        return Mount(
            "bind" if kind in ("", "volume") and is_path(source) else kind or "volume",
            _clean(source),
            _clean(target),
            span,
            is_true(texts.get("read_only") or ""),
            kind == "bind" and required is not None and not is_true(of.literal(required)),
            "nocopy" in volume and is_true(of.literal(volume["nocopy"])),
            _memory(of, own.get("tmpfs")) if kind == "tmpfs" else (),
        )
    return None


def _clean(path: str) -> str:
    return os.path.normpath(f"/{path.lstrip('/')}") if path.startswith("/") else path


def _memory(of: "Container", node: Node | None) -> tuple[tuple[str, Any], ...]:
    fields, most = of.fields(node, "'tmpfs' of a mount", "size mode"), of.limits.memory
    made = capped(of, fields["size"], "volumes.tmpfs.size", most, "memory", size) if "size" in fields else most
    return (("size", made), *((("mode", plain(fields["mode"])),) if "mode" in fields else ()))


def _carried(of: "Container", mount: Mount) -> Mount | None:
    if mount.kind == "bind":
        return _bound(of, mount)
    known = of.project.volumes
    if mount.kind == "volume" and mount.source and mount.source not in known:
        hint = did_you_mean(mount.source, known)
        hint = hint if hint.startswith("did") else f"declare it at the end of the file: 'volumes: {{{mount.source}: }}'"
        message = f"'{of.name}' mounts the volume '{mount.source}', which the top-level 'volumes' do not declare"
        of.bad(mount.span, message, hint)
        return None
    if mount.kind != "volume" or not mount.source:
        return mount
    if known[mount.source] and not mount.read_only:
        hint = "mount it read-only (:ro), or remove 'external', so that compose creates it"
        of.refuse(mount.span, f"volume '{mount.source}' is external, so tests would share it", hint)
    return replace(mount, source=own_name(mount.source))


def _bound(of: "Container", mount: Mount) -> Mount | None:
    project, source, own_network = of.project, mount.source, of.project.setting.own_network
    paths = project.paths
    if not source:
        of.bad(mount.span, f"a folder that '{of.name}' mounts has no 'source'", "name it, or write 'type: volume'")
    elif "\0" in source:
        of.refuse(mount.span, NUL, "remove it")
    elif source == MEMORY or source.startswith(f"{MEMORY}/"):
        return None if own_network else mount
    elif source == TMP or is_token(source, mount.target):
        target = mount.target if source == TMP else TMP
        if own_network:
            return replace(mount, kind="volume", source="tmp", target=target, nocopy=True, is_required=False)
        return replace(mount, source=TMP, target=target)
    elif paths.is_hardware(source, read_only=mount.read_only):
        is_own = is_port(paths.whole(source), project.ports)
        return mount if is_kept(of, mount.span, f"'{source}'", is_own) else None
    elif found := paths.mount_problem(source):
        of.refuse(mount.span, *found)
    elif mount.is_required and not os.path.lexists(paths.whole(source)):
        message = f"there is no file or folder '{source}', and 'create_host_path: false' requires it"
        of.bad(mount.span, message, "create it, or remove 'create_host_path'; paths are relative to this file")
    else:
        project.show(source, mount.span, "" if mount.read_only else of.name)
        if not mount.read_only:
            project.copy(source)
        return replace(mount, is_own=True)
    return None


def nested(project: "Construction") -> Iterator[tuple[Span, str, str]]:
    """Mounts in a folder to which a service may write, where it could put a link in their place: place, message, hint.

    Only what ``dodo.yml`` names can be written to; all else are copies.
    """
    paths = project.paths
    open_ = [(Path(paths.names(s)[-1]), w) for s, _, w in project.shown if w and paths.is_writable(s)]
    for source, span, _ in project.shown if open_ else ():
        whole = Path(paths.whole(source))
        places = [Path(os.path.realpath(place.parent)) / place.name for place in (whole, *whole.parents)]
        for outer, writer in open_:
            if any(outer in place.parents for place in [*places, *map(Path, paths.names(source))]):
                message = f"'{source}' lies in '{outer}', where '{writer}' could put a link in its place"
                yield span, message, f"mount '{outer}' in both, or read-only (:ro)"
                break
