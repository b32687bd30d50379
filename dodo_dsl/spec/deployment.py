"""The deployment: ``dodo.yml`` at the root of a user's repository, with the limits and services that it gives.

``sandbox`` has limits, with sizes that can be. ``services`` are folders that hold a folder with a manifest for each
service.
"""

import ipaddress
import os
import posixpath
import re
import shlex
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from dodo_dsl import __version__, package_data
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Entry, Mapping, Node, Reader, Scalar, Sequence, path_of, plain, read, walk
from dodo_dsl.spec import rig
from dodo_dsl.spec.quantity import convert
from dodo_dsl.spec.rig import Rig
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from dodo_dsl.spec.slips import mended
from dodo_dsl.spec.validation import schema_of, valid_part


def sandbox_limits(entry: Entry | None) -> SandboxLimits:
    """The limits that a valid ``dodo.yml`` sets."""
    node = entry.value if entry else None
    if not isinstance(node, Mapping):
        return SandboxLimits()
    default = SandboxLimits()
    reads = node.get("read")
    return SandboxLimits(
        _bytes(node.get("memory"), default.memory),
        _count(node.get("processes"), default.processes),
        _count(node.get("files"), default.files),
        _bytes(node.get("file-size"), default.file_size),
        tuple(i.text for i in reads.items if isinstance(i, Scalar)) if isinstance(reads, Sequence) else (),
        float(str(cpus.value)) if isinstance(cpus := node.get("cpus"), Scalar) else None,
        _bytes(node.get("copies"), default.copies),
        _count(node.get("copied-files"), default.copied_files),
    )


def _bytes(node: object, default: int) -> int:
    return int(convert(node.text, "B")) if isinstance(node, Scalar) else default


def _count(node: object, default: int) -> int:
    return node.value if isinstance(node, Scalar) and isinstance(node.value, int) else default


RULE = "service-folder"
MANIFEST = "service.yml"
_TAKEN = ("services", "dodo_dsl")


def service_folder_problems(root: Path, node: Node | None) -> Iterator[Diagnostic]:
    """Folders that are a service themselves, and warnings for those without any and those that DoDo's packages hide.

    Folders that do not exist are reported elsewhere.
    """
    for item in walk(node) if node is not None else ():
        folder = path_of(root, item.text) if isinstance(item, Scalar) else None
        if folder is None or not isinstance(item, Scalar) or not folder.is_dir():
            continue
        if (folder / MANIFEST).is_file():
            yield Diagnostic(item.span, RULE, f"'{item.text}' is the folder of one service", _above(root, folder))
        elif not any(folder.glob(f"*/{MANIFEST}")):
            message = f"'{item.text}' holds no service"
            hint = f"a service is a folder in it with a {MANIFEST}: {item.text.rstrip('/')}/NAME/{MANIFEST}"
            yield Diagnostic(item.span, RULE, message, hint, severity="warning")
        elif folder.name in _TAKEN:
            message = f"Python finds DoDo's own package '{folder.name}' before this folder"
            hint = f"give it another name, such as my_{folder.name}, also in 'process' of its services"
            yield Diagnostic(item.span, RULE, message, hint, severity="warning")


def _above(root: Path, folder: Path) -> str:
    above, root = folder.parent, root.resolve()
    if above != root and above.is_relative_to(root):
        return f"name the folder above it: {above.relative_to(root).as_posix()}"
    return f"move it to my_services/{folder.name}, and name the folder above it: my_services"


_ODVD_PLACE = re.compile(r"(?P<file>.+?):((?P<line>\d+):(?P<column>\d+):)? (?P<text>.+)", re.DOTALL)
FILE_NAME = "dodo.yml"
SHIPPED = "dodo:"
RESERVED_CIDS = frozenset({111, 112})
_NO_CID = 0
"""Of a rig whose own is not valid."""
_FROM_HERE = "paths are relative to the folder of dodo.yml"
_NOT_YET = f"dodo new NAME makes it, with a first test; {_FROM_HERE}"
_OF_GANTRY = ("serial", "limits", "axes")
_NETWORK = "for example 10.213.0.0/16"
DEFAULT_SUBNETS = ipaddress.IPv4Network("10.213.0.0/16")


@dataclass(frozen=True)
class Declarations:
    """What ``dodo.yml`` states about an application in addition to its compose ``files``, at its position there.

    ``without`` names services that no test starts. ``services`` have the keys of ``x-dodo``, and ``process``, by name.
    ``own`` are the keys of ``x-dodo`` of the whole application.
    """

    files: tuple[Path, ...] = ()
    without: tuple[Scalar, ...] = ()
    services: dict[str, Entry] = field(default_factory=dict)
    own: dict[str, Entry] = field(default_factory=dict)

    @classmethod
    def of(cls, entry: Entry | None, files: tuple[Path, ...]) -> "Declarations":
        """Those of a valid ``application``."""
        node = entry.value if entry else None
        if not isinstance(node, Mapping):
            return cls(files)
        services = node.get("services")
        declared = services.entries if isinstance(services, Mapping) else {}
        own = {key: entry for key, entry in node.entries.items() if key not in ("files", "without", "services")}
        return cls(files, tuple(_texts(node.entries.get("without"))), dict(declared), own)


@dataclass(frozen=True)
class Deployment:
    """Where tests and application are; ``root`` is the folder of ``dodo.yml``, or the working folder without one.

    ``environment`` names variables of DoDo's own environment that the application gets, ``paths`` are files and folders
    of the host that it may mount, and ``outside`` means that it may reach other networks than its test's. ``absent``
    are folders of the registry that do not exist.
    """

    root: Path
    file: Path | None = None
    registry: tuple[Path, ...] = ()
    absent: tuple[Path, ...] = ()
    services: tuple[Path, ...] = ()
    messages: tuple[Path, ...] = ()
    application: tuple[Path, ...] = ()
    declarations: Declarations = field(default_factory=Declarations)
    image_prefix: str = "dodo"
    image_tag: str = __version__
    cids: tuple[int, ...] = tuple(range(128, 255))
    subnets: ipaddress.IPv4Network = DEFAULT_SUBNETS
    gates: bool = True
    environment: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    outside: bool = False
    rigs: dict[str, Rig] = field(default_factory=dict)
    sandbox: SandboxLimits = field(default_factory=SandboxLimits)

    def rig(self, name: str) -> Rig | None:
        """A rig of the deployment, or an emulated one."""
        return self.rigs.get(name) or (rig.emulated(name) if name in rig.EMULATED_RIGS else None)


def build_command(prefix: str, tag: str, *names: str) -> str:
    """What builds images of DoDo's with this prefix and tag, also if ``dodo.yml`` does not name them."""
    flags = [*(["--prefix", prefix] if prefix != Deployment.image_prefix else [])]
    flags += ["--tag", tag] if tag != Deployment.image_tag else []
    return shlex.join(["dodo", "images", "build", *names, *flags])


def find_deployment(start: Path, paths: Iterable[Path] = ()) -> Path | None:
    """The nearest ``dodo.yml`` at or above a folder; if there is none, the one that is above all ``paths``."""
    folder = start.resolve()
    for candidate in (folder, *folder.parents):
        if (candidate / FILE_NAME).is_file():
            return candidate / FILE_NAME
    above = {find_deployment(path if path.is_dir() else path.parent) for path in paths}
    return above.pop() if len(above) == 1 else None


def load_deployment(path: Path | None, reader: Reader = read) -> tuple[Deployment, list[Diagnostic]]:
    """The deployment of a ``dodo.yml``; without one, the shipped registry and no application."""
    if path is None:
        return Deployment(Path.cwd(), registry=(package_data.registry(),)), []
    node, found = reader(path)
    if node is None and not found:
        found = [Diagnostic(Span(str(path)), "missing-key", "the file is empty, expected at least 'dodo: 1'")]
    if node is not None:
        node, slipped = mended(node, schema_of("deployment"))
        node, problems, _ = valid_part(node, "deployment")
        found = [*found, *slipped, *problems]
    if not isinstance(node, Mapping):
        return Deployment(path.parent, path, registry=(package_data.registry(),)), found
    raw = plain(node)
    images = raw.get("images", {})
    problems = []
    rigs = _rigs(node.entries.get("rigs"), problems)
    reserved = {r.cid for r in rigs.values()}
    registry, absent = _registry(path.parent, node.entries.get("registry"), problems)
    about = node.entries.get("application")
    named = about.value.entries.get("files") if about and isinstance(about.value, Mapping) else about
    application = _files(path.parent, named, problems)
    deployment = Deployment(
        root=path.parent,
        file=path,
        registry=registry or (package_data.registry(),),
        absent=absent,
        services=_folders(path.parent, node.entries.get("services"), problems),
        messages=_files(path.parent, node.entries.get("messages"), problems),
        application=application,
        declarations=Declarations.of(about, application),
        image_prefix=images.get("prefix", "dodo"),
        image_tag=images.get("tag", __version__),
        cids=tuple(cid for cid in _cids(node.entries.get("cids"), problems) if cid not in reserved),
        subnets=_subnets(node.entries.get("subnets"), problems),
        gates=raw.get("gates", True),
        environment=tuple(raw.get("environment", ())),
        paths=_host_paths(node.entries.get("paths"), problems),
        outside=raw.get("outside", False),
        rigs=rigs,
        sandbox=sandbox_limits(node.entries.get("sandbox")),
    )
    _odvd(node.entries.get("messages"), deployment.messages, problems)
    problems += service_folder_problems(path.parent, node.get("services"))
    return deployment, [*found, *problems]


def _texts(entry: Entry | None) -> Iterator[Scalar]:
    """The strings of a list, or the single string written instead of one."""
    value = entry.value if entry else None
    for item in value.items if isinstance(value, Sequence) else (value,):
        if isinstance(item, Scalar):
            yield item


def _registry(root: Path, entry: Entry | None, problems: list[Diagnostic]) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """The folders with tests, and those that do not exist."""
    found: list[Diagnostic] = []
    folders = _folders(root, entry, found)
    missing = (path for item in _texts(entry) if item.text != SHIPPED and (path := path_of(root, item.text)))
    absent = tuple(path for path in missing if not path.exists() and path.is_relative_to(root.resolve()))
    if absent and all(package_data.is_shipped(folder, root) for folder in folders):
        found = [replace(d, hint=_NOT_YET) for d in found]
    problems.extend(found)
    return folders, absent


def _folders(root: Path, entry: Entry | None, problems: list[Diagnostic]) -> tuple[Path, ...]:
    folders = []
    for item in _texts(entry):
        folder = package_data.registry() if item.text == SHIPPED else path_of(root, item.text)
        if folder is None or not folder.is_dir():
            problems.append(Diagnostic(item.span, "missing-file", f"there is no folder '{item.text}'", _FROM_HERE))
        else:
            folders.append(folder)
    return tuple(folders)


def _files(root: Path, entry: Entry | None, problems: list[Diagnostic]) -> tuple[Path, ...]:
    files = []
    for item in _texts(entry):
        path = path_of(root, item.text)
        if path is not None and path.is_file():
            files.append(root / item.text)
        else:
            problems.append(Diagnostic(item.span, "missing-file", f"there is no file '{item.text}'", _FROM_HERE))
    return tuple(files)


def _host_paths(entry: Entry | None, problems: list[Diagnostic]) -> tuple[str, ...]:
    paths = []
    for item in _texts(entry):
        path = posixpath.normpath(os.path.expanduser(item.text))  # noqa: PTH111  (it never raises)
        if not path.startswith("/") or path.strip("/") == "":
            message = f"'{item.text}' is not the whole path of a file or folder"
            problems.append(Diagnostic(item.span, "wrong-value", message, "for example /etc/ros"))
        else:
            paths.append(path)
    return tuple(paths)


def _odvd(entry: Entry | None, files: tuple[Path, ...], problems: list[Diagnostic]) -> None:
    """Problems of the deployment's ODVD files."""
    if not files or entry is None:
        return
    from dodo_dsl.opendlv.message_set import MessageSet  # slow to load, and rarely needed
    from dodo_dsl.opendlv.odvd import OdvdError

    try:
        MessageSet.load(*files)
    except OdvdError as error:
        place = _ODVD_PLACE.fullmatch(str(error))
        span, text = entry.key, str(error)
        if place:
            span, text = Span(place["file"], int(place["line"] or 1), int(place["column"] or 1)), place["text"]
        problems.append(Diagnostic(span, "wrong-messages", text))


def _rigs(entry: Entry | None, problems: list[Diagnostic]) -> dict[str, Rig]:
    rigs: dict[str, Rig] = {}
    taken: dict[int | None, str] = {}
    for name, written in entry.value.entries.items() if entry and isinstance(entry.value, Mapping) else ():
        if not isinstance(written.value, Mapping):
            continue
        raw = plain(written.value)
        cid = None if raw.get("emulated") else raw.get("cid", _NO_CID)
        found = rigs[name] = Rig(name, raw.get("kind", "dynamic"), cid, written.value)
        if cid is not None and name in rig.EMULATED_RIGS:
            message = f"the name '{name}' is reserved for the built-in rig"
            problems.append(Diagnostic(written.key, "rig-name", message, "choose another name"))
        elif cid not in (None, _NO_CID) and (cid in taken or cid in RESERVED_CIDS):
            owner = f"rig '{taken[cid]}'" if cid in taken else "real cars"
            message = f"CID {cid} is taken by {owner}, expected one that only this rig has"
            problems.append(Diagnostic(written.value.entries["cid"].value.span, "rig-cid", message))
        taken.setdefault(cid, name)
        problems.extend(_tags(found))
        problems.extend(_unused(found))
    return rigs


def _unused(found: Rig) -> Iterator[Diagnostic]:
    """Keys about what moves, of a rig that does not."""
    for key in _OF_GANTRY if found.kind == "static" else ():
        if key in found.node.entries:
            message = f"a static rig does not use '{key}'"
            hint = "remove it, or write the kind of a rig that moves: dynamic or circle"
            yield Diagnostic(found.node.entries[key].key, "unknown-key", message, hint, "warning")


def _tags(found: Rig) -> Iterator[Diagnostic]:
    """Tags that would send a rig's jobs to a runner that is none of its kind's."""
    node = found.node.get("tags")
    for item in node.items if isinstance(node, Sequence) else ():
        if isinstance(item, Scalar) and item.text in rig.RESERVED_TAGS - {*rig.KIND_TAGS[found.kind]}:
            message = f"'{item.text}' is the tag of other runners, those of rig '{found.name}' have '{found.tag}'"
            yield Diagnostic(item.span, "rig-tag", message, "remove it, or choose the rig's own tag")


def _cids(entry: Entry | None, problems: list[Diagnostic]) -> tuple[int, ...]:
    if entry is None or not isinstance(entry.value, Scalar):
        return Deployment.cids
    low, high = (int(part) for part in entry.value.text.split("-"))
    if not 1 <= low <= high <= 254:
        message = f"'{entry.value.text}' is not a range of CIDs, expected numbers from 1 to 254, the lower one first"
        problems.append(Diagnostic(entry.value.span, "out-of-range", message))
        return Deployment.cids
    return tuple(cid for cid in range(low, high + 1) if cid not in RESERVED_CIDS)


def _subnets(entry: Entry | None, problems: list[Diagnostic]) -> ipaddress.IPv4Network:
    if entry is None or not isinstance(entry.value, Scalar):
        return DEFAULT_SUBNETS
    try:
        network = ipaddress.IPv4Network(entry.value.text)
    except ValueError as error:
        problems.append(Diagnostic(entry.value.span, "wrong-value", f"not an IPv4 network: {error}", _NETWORK))
        return DEFAULT_SUBNETS
    if network.prefixlen > 28:
        message = f"'{entry.value.text}' is too small, every test needs a /28"
        problems.append(Diagnostic(entry.value.span, "out-of-range", message))
        return DEFAULT_SUBNETS
    return network
