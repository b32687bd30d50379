"""What a test's containers mount: files of the repository to be read, copies of its folders, the test's own volumes.

Whatever is neither of these is refused, or is a rig's hardware.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dodo_dsl.application.compose_paths import escaped, is_path
from dodo_dsl.application.host_paths import MEMORY, TMP, is_port, is_token
from dodo_dsl.application.limits import size, tmpfs_options
from dodo_dsl.application.model import is_true, plain
from dodo_dsl.application.part import NO_PORT, WITHOUT_HARDWARE, Part
from dodo_dsl.diagnostics import Fix, Span, did_you_mean, only_fix
from dodo_dsl.source import Mapping, Node, Scalar

if TYPE_CHECKING:
    from dodo_dsl.application.construction import Construction
    from dodo_dsl.application.container import Container

OWN_VOLUMES = ("tmp", "report", "dodo-channel", "dodo-time")
"""The names of DoDo's own volumes in a test; an application's volumes of these names get others."""
COPY = "files-"
"""How the volumes of copies begin, each with a number."""
_OF_COPY = re.compile(rf"{COPY}\d+")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_KINDS = ("bind", "volume", "tmpfs", "image")
_BIND_OPTIONS = {"propagation": ("private", "rprivate"), "recursive": ("enabled", "disabled", "readonly")}
_IN_AND_OUT = ("shared", "rshared", "slave", "rslave")
_OPTIONS = "use a tmpfs (type: tmpfs), or a folder of the repository (o: bind)"
_FIELDS = {
    "": "type source target read_only consistency bind volume tmpfs image",
    "bind": "propagation create_host_path selinux recursive",
    "volume": "nocopy labels subpath",
    "tmpfs": "size mode",
    "image": "subpath",
}


@dataclass(frozen=True)
class Mount:
    """An entry of ``volumes``, whose ``source`` is a path, a volume's name, or empty; ``span`` is the source's place.

    ``more`` are the options of a volume, of an image or of a file system in memory.
    """

    kind: str
    source: str
    target: str
    span: Span
    read_only: bool = False
    is_required: bool = False
    selinux: str = ""
    nocopy: bool = False
    more: tuple[tuple[str, Any], ...] = ()
    is_short: bool = False

    def written(self) -> str | dict[str, Any]:
        """As compose reads it."""
        source, target = escaped(self.source), escaped(self.target)
        words = [*(["ro"] if self.read_only else []), *(["nocopy"] if self.nocopy else [])]
        words += [self.selinux] if self.selinux else []
        is_short = ":" not in f"{source}{target}" and len(source) != 1 and not self.is_required and not self.more
        if is_short and self.kind in ("bind", "volume"):
            return ":".join(filter(None, (source, target, ",".join(words))))
        about = dict(self.more) | ({"nocopy": True} if self.nocopy else {})
        if self.kind == "bind":
            about = {"create_host_path": not self.is_required} | ({"selinux": self.selinux} if self.selinux else {})
        made: dict[str, Any] = {"type": self.kind, "source": source, "target": target}
        made |= {"read_only": True} if self.read_only else {}
        return {key: value for key, value in {**made, self.kind: about}.items() if value not in ("", {})}


def own_name(name: str) -> str:
    """The name of an application's volume in the test's project, where DoDo has its own volumes."""
    return f"application-{name}" if name in OWN_VOLUMES or _OF_COPY.fullmatch(name) else name


def mounts(of: "Container", node: Node) -> list[str | dict[str, Any]]:
    """The mounts of a service, each once."""
    made: dict[tuple[str, str], str | dict[str, Any]] = {}
    for item in of.items(node):
        mount = _long(of, item) if isinstance(item, Mapping) else _short(of, item)
        if mount and not mount.target:
            of.bad(mount.span, f"a mount of '{of.name}' has no target", "name its folder in the container")
            continue
        mount = _carried(of, mount) if mount else None
        if mount:
            made[mount.source, mount.target] = mount.written()
    return list(made.values())


def _short(of: "Container", item: Node) -> Mount | None:
    text = of.literal(item)
    if text is None:
        return None
    source, target, options, *_ = [*text.split(":", 2), "", ""] if ":" in text else ["", text, ""]
    if ":" in text and not source:
        of.bad(
            item.span, f"the mount '{text}' of '{of.name}' has no source", "name a folder or a volume before the colon"
        )
        return None
    words = options.split(",")
    if found := [word for word in words if word in _IN_AND_OUT]:
        of.refuse(item.span, f"'{found[0]}' of a mount reaches beyond the container", "remove it")
        return None
    return Mount(
        "bind" if is_path(source) else "volume", _clean(source), _clean(target), item.span,
        [word for word in words if word in ("ro", "rw")][-1:] == ["ro"],
        selinux=next((word for word in words if word in ("z", "Z")), ""), nocopy="nocopy" in words, is_short=True,
    )  # fmt: skip


def _clean(path: str) -> str:
    return os.path.normpath(f"/{path.lstrip('/')}") if path.startswith("/") else path


def _long(of: "Container", item: Mapping) -> Mount | None:
    about = {key: of.fields(item.get(key), f"'{key}' of a mount", known) for key, known in _FIELDS.items() if key}
    own = of.fields(item, "a mount", _FIELDS[""])
    values = {key: of.literal(node) for key, node in own.items() if isinstance(node, Scalar)}
    kind, source, span = values.get("type") or "volume", values.get("source") or "", item.span
    if isinstance(node := own.get("source"), Scalar):
        span = node.span
    if kind not in _KINDS:
        of.refuse(own["type"].span, f"mounts of type '{kind}' cannot be isolated", "use a folder or a volume")
        return None
    told = {f"{key}.{name}": of.literal(node) or "" for key, nodes in about.items() for name, node in nodes.items()}
    for key, allowed in _BIND_OPTIONS.items():
        if told.get(f"bind.{key}", "") not in ("", *allowed):
            message = f"'{key}: {told[f'bind.{key}']}' of a mount reaches beyond the container"
            of.refuse(about["bind"][key].span, message, "remove it")
            return None
    kind = "bind" if kind == "volume" and is_path(source) else kind
    more: dict[str, Any] = {}
    if kind == "tmpfs":
        most = of.limits.memory
        more = {"size": most} | ({"mode": plain(about["tmpfs"]["mode"])} if told.get("tmpfs.mode") else {})
        if 0 < size(told.get("tmpfs.size", "")) <= most:
            more["size"] = int(size(told["tmpfs.size"]))
        elif "tmpfs.size" in told:
            of.cut(about["tmpfs"]["size"].span, "volumes.tmpfs.size", most, "memory")
    elif told.get(f"{kind}.subpath"):
        more = {"subpath": escaped(told[f"{kind}.subpath"])}
    return Mount(
        kind, _clean(source), _clean(values.get("target") or ""), span, is_true(values.get("read_only") or ""),
        kind == "bind" and told.get("bind.create_host_path", "true").lower() == "false",
        told.get("bind.selinux", ""), is_true(told.get("volume.nocopy", "")), tuple(more.items()),
    )  # fmt: skip


def _carried(of: "Container", mount: Mount) -> Mount | None:
    """The mount as the test has it; None where it has none."""
    if mount.kind == "bind":
        return _bound(of, mount)
    if mount.kind != "volume" or not mount.source:
        return mount
    known = of.project.volumes
    if mount.source not in known:
        hint = did_you_mean(mount.source, known)
        hint = hint if hint.startswith("did") else f"declare it at the end of the file: 'volumes: {{{mount.source}: }}'"
        message = f"'{of.name}' mounts the volume '{mount.source}', which the top-level 'volumes' do not declare"
        near = only_fix(mount.source, known)
        of.bad(
            mount.span, message, hint, fix=Fix(f"{near.old}:/", f"{near.new}:/") if near and mount.is_short else near
        )
        return None
    if known[mount.source].is_external and not mount.read_only:
        hint = "mount it read-only (:ro), or remove 'external', so that compose creates it"
        of.refuse(mount.span, f"volume '{mount.source}' is external, so tests would share it", hint)
        return None
    about = known[mount.source]
    is_read = mount.read_only or "ro" in str(about.made.get("driver_opts", {}).get("o")).split(",")
    of.project.show(about.device, about.span, "" if is_read else of.name)
    own = own_name(mount.source)
    return replace(mount, source=own, nocopy=mount.nocopy or own in of.project.copies)


def _bound(of: "Container", mount: Mount) -> Mount | None:
    paths, source, setting = of.project.paths, mount.source, of.project.setting
    if not source:
        of.bad(mount.span, f"a folder that '{of.name}' mounts has no 'source'", "name it, or write 'type: volume'")
    elif "\0" in source:
        of.refuse(mount.span, *paths.mount_problem(source))
    elif source == MEMORY or source.startswith(f"{MEMORY}/"):
        return None if setting.own_network else mount
    elif source == TMP or is_token(source, mount.target):
        target = mount.target if source == TMP else TMP
        if setting.own_network:
            return replace(mount, kind="volume", source="tmp", target=target, nocopy=True, is_required=False)
        return replace(mount, source=TMP, target=target)
    elif is_port(paths.whole(source), of.project.ports):
        of.hardware(mount.span, f"'{source}' of '{of.name}' {NO_PORT}", "give the application another device")
    elif paths.is_of_machine(source) and source.startswith(("/", "~")):
        of.refuse(mount.span, f"'{source}' gives access to the host's disks or memory", "remove it")
    elif paths.is_hardware(source, read_only=mount.read_only):
        if setting.hil:
            return mount
        of.hardware(mount.span, f"'{source}' of '{of.name}' {WITHOUT_HARDWARE}")
    elif found := paths.mount_problem(source)[0] and paths.mount_problem(source):
        of.refuse(mount.span, *found)
    else:
        return _of_repository(of, mount)
    return None


def _of_repository(of: "Container", mount: Mount) -> Mount | None:
    project, source = of.project, mount.source
    if mount.is_required and not os.path.lexists(project.paths.whole(source)):
        message = f"there is no file or folder '{source}', and 'create_host_path: false' requires it"
        of.bad(mount.span, message, "create it, or remove 'create_host_path'; paths are relative to this file")
        return None
    project.show(source, mount.span, "" if mount.read_only else of.name)
    if name := project.copied(source) if mount.read_only else project.copy_of(source):
        return replace(mount, kind="volume", source=name, nocopy=True, is_required=False, selinux="")
    read_only = mount.read_only or not project.paths.is_writable(source)
    return replace(mount, source=project.rebased(source), read_only=read_only)


@dataclass(frozen=True)
class Volume:
    """A top-level volume: ``made`` as the test has it, ``device`` the folder of the host that it shows, if it does."""

    made: dict[str, Any]
    span: Span
    device: str = ""
    is_external: bool = False


def volume(project: "Construction", name: str, node: Node, span: Span) -> Volume:
    """A top-level volume of an application, each test having its own."""
    of = Part(project, f"the volume '{name}'", span)
    about = of.fields(node, f"the volume '{name}'", "driver driver_opts external name", "labels")
    driver = of.literal(about["driver"]) if "driver" in about else "local"
    if driver not in ("local", "", None):
        message = f"the driver '{driver}' of the volume '{name}' reaches beyond the test"
        of.refuse(about["driver"].span, message, "remove it, so that the engine makes its own volume")
    external = about.get("external")
    if isinstance(external, Mapping) or (isinstance(external, Scalar) and is_true(external.value)):
        word = external.get("name") if isinstance(external, Mapping) else about.get("name")
        called = (of.literal(word) if word else name) or name
        if called.startswith("dodo-") or not _NAME.fullmatch(called):
            of.refuse((word or node).span, f"'{called}' is not a name that a volume of the application may have", "")
        return Volume({"external": True, "name": called}, span, is_external=True)
    options = about.get("driver_opts")
    made, device = _options(of, name, options) if options else ({}, "")
    return Volume(made, options.span if options else span, device)


def _options(of: Part, name: str, node: Node) -> tuple[dict[str, Any], str]:
    """A tmpfs, or a folder that may be mounted; with other options the engine mounts disks and shares of networks."""
    if not isinstance(node, Mapping):
        of.refuse(node.span, f"'driver_opts' of the volume '{name}' is not a mapping", _OPTIONS)
        return {}, ""
    fields = of.fields(node, f"'driver_opts' of the volume '{name}'", "type o device")
    kind, flags, device = (of.literal(fields[key]) or "" if key in fields else "" for key in ("type", "o", "device"))
    words = [word.strip() for word in flags.split(",") if word.strip()]
    span = next((fields[key].span for key in ("type", "o", "device") if key in fields), node.span)
    if {"bind", "rbind"} & set(words):
        return _folder(of, name, device, words, fields.get("device", node).span)
    options, is_cut, unknown = tmpfs_options(flags, of.limits)
    if kind != "tmpfs" or unknown:
        if flags or kind or device:
            what = unknown if kind == "tmpfs" else kind or flags or device
            of.refuse(span, f"the volume '{name}' mounts '{what}', which reaches beyond the test", _OPTIONS)
        return {}, ""
    if is_cut:
        of.cut(fields["o"].span, f"{name}.driver_opts.o", of.limits.memory, "memory")
    return {"driver_opts": {"type": "tmpfs", "device": "tmpfs", "o": options}}, ""


def _folder(of: Part, name: str, device: str, words: list[str], span: Span) -> tuple[dict[str, Any], str]:
    paths = of.project.paths
    unknown = set(words) - {"bind", "rbind", "rw", "ro", "nosuid", "nodev", "noexec"}
    if not device:
        of.bad(span, f"the volume '{name}' has no 'device'", "name a folder of the repository")
        return {}, ""
    if unknown or paths.is_hardware(device) or paths.is_of_machine(device):
        what = f"the option '{min(unknown)}'" if unknown else f"'{device}' of the host"
        of.refuse(span, f"the volume '{name}' has {what}", _OPTIONS)
        return {}, ""
    if (found := paths.mount_problem(device))[0]:
        of.refuse(span, *found)
        return {}, ""
    is_read = [word for word in words if word in ("ro", "rw")][-1:] == ["ro"]
    if of.project.copy_of(device, own_name(name)):
        return {}, device
    if not device.startswith(("/", "~")):
        of.bad(span, f"the volume '{name}' is a file, which compose cannot find", "mount the file itself")
        return {}, ""
    access = [] if paths.is_writable(device) and not is_read else ["ro"]
    options = [word for word in words if word not in ("ro", "rw")] + access
    return {"driver_opts": {"type": "none", "device": escaped(device), "o": ",".join(options)}}, device


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
