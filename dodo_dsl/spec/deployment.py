"""The deployment: ``dodo.yml`` at the root of a user's repository."""

import ipaddress
import os
import posixpath
import re
import shlex
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl import __version__, package_data
from dodo_dsl.diagnostics import Diagnostic, Severity, Span
from dodo_dsl.source import Entry, Mapping, Node, Scalar, Sequence, entries, part, path_of, plain, read
from dodo_dsl.spec import rig
from dodo_dsl.spec.registry import refuse_yaml
from dodo_dsl.spec.rig import Rig
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from dodo_dsl.spec.validation import schema_of_keys, valid_part, values

_ROS = (".msg", ".idl")
"""The suffixes of files with types of ROS."""
_ODVD_PLACE = re.compile(r"(?P<file>.+?):((?P<line>\d+):(?P<column>\d+):)? (?P<text>.+)", re.DOTALL)
FILE_NAME = "dodo.yml"
SHIPPED = "dodo:"
RESERVED_CIDS = frozenset({111, 112})
_NO_CID = 0
"""Of a rig whose own is not valid."""
_FROM_HERE = "paths are relative to the folder of dodo.yml"
_NOT_YET = f"dodo new NAME makes it, with a first test; {_FROM_HERE}"
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
        node = entry.value if entry else None
        own = {key: e for key, e in entries(node).items() if key not in ("files", "without", "services")}
        return cls(files, tuple(_texts(part(node, "without"))), dict(entries(node, "services")), own)


@dataclass(frozen=True)
class Deployment:
    """Where tests and application are; ``root`` is the folder of ``dodo.yml``, or the working folder without one.

    ``messages`` are files of OpenDLV messages (ODVD), ``ros_types`` those of ROS types (.msg, .idl).

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
    ros_types: tuple[Path, ...] = ()
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
        return self.rigs.get(name) or (rig.emulated(name) if name in rig.EMULATED_RIGS else None)


def build_command(prefix: str, tag: str, *names: str) -> str:
    """What builds images of DoDo's with this prefix and tag, also if ``dodo.yml`` does not name them."""
    flags = [*(["--prefix", prefix] if prefix != Deployment.image_prefix else [])]
    flags += ["--tag", tag] if tag != Deployment.image_tag else []
    return shlex.join(["dodo", "images", "build", *names, *flags])


def find_deployment(start: Path, paths: Iterable[Path] = ()) -> Path | None:
    """The nearest ``dodo.yml`` at or above a folder; if there is none, the one that is above all ``paths``.

    Raises RegistryError for a ``dodo.yaml``.
    """
    folder = start.resolve()
    for candidate in (folder, *folder.parents):
        if (candidate / FILE_NAME).is_file():
            return candidate / FILE_NAME
        refuse_yaml((candidate / FILE_NAME).with_suffix(".yaml"))
    above = {find_deployment(path if path.is_dir() else path.parent) for path in paths}
    return above.pop() if len(above) == 1 else None


def load_deployment(path: Path | None) -> tuple[Deployment, list[Diagnostic]]:
    """The deployment of a ``dodo.yml``; without one, the shipped registry and no application."""
    if path is None:
        return Deployment(Path.cwd(), registry=(package_data.registry(),)), []
    node, found = read(path)
    if node is None and not found:
        found = [Diagnostic(Span(str(path)), "missing-key", "the file is empty, expected at least 'dodo: 1'")]
    if node is not None:
        node, problems, _ = valid_part(node, "deployment")
        found = [*found, *problems]
    if not isinstance(node, Mapping):
        return Deployment(path.parent, path, registry=(package_data.registry(),)), found
    reading = _Reading(path.parent, node)
    return reading.deployment(path), [*found, *reading.problems]


def _texts(node: Node | None) -> list[Scalar]:
    """The strings of a list, or the single string written instead of one."""
    items = node.items if isinstance(node, Sequence) else (node,)
    return [item for item in items if isinstance(item, Scalar)]


class _Reading:
    def __init__(self, root: Path, node: Mapping) -> None:
        self.root, self.node, self.raw = root, node, plain(node)
        self.problems: list[Diagnostic] = []

    def deployment(self, path: Path) -> Deployment:
        raw, rigs = self.raw, self._rigs()
        images, reserved = raw.get("images", {}), {rig.cid for rig in rigs.values()}
        about, named = self.node.entries.get("application"), self.node.get("application")
        named = named.get("files") if isinstance(named, Mapping) else named
        application, services = self._files(named), self._folders("services")
        messages = self._files(self.node.get("messages"))
        registry = tuple(self._folders("registry", _NOT_YET))
        shipped = package_data.registry()
        missing = (path_of(self.root, item.text) for item in _texts(self.node.get("registry")) if item.text != SHIPPED)
        found = Deployment(
            root=self.root,
            file=path,
            registry=registry or (shipped,),
            absent=tuple(p for p in missing if p and not p.exists() and p.is_relative_to(self.root.resolve())),
            services=tuple(services),
            messages=tuple(path for path in messages if path.suffix not in _ROS),
            ros_types=tuple(path for path in messages if path.suffix in _ROS),
            application=application,
            declarations=Declarations.of(about, application),
            image_prefix=images.get("prefix", "dodo"),
            image_tag=images.get("tag", __version__),
            cids=tuple(cid for cid in self._cids() if cid not in reserved),
            subnets=self._subnets(),
            gates=raw.get("gates", True),
            environment=tuple(raw.get("environment", ())),
            paths=self._paths(),
            outside=raw.get("outside", False),
            rigs=rigs,
            sandbox=_sandbox(self.node.get("sandbox")),
        )
        self._check_messages(found.messages)
        self._check_types(found.ros_types)
        return found

    def _tell(self, span: Span, rule: str, message: str, hint: str = "", severity: Severity = "error") -> None:
        self.problems.append(Diagnostic(span, rule, message, hint, severity))

    def _folders(self, key: str, hint: str = _FROM_HERE) -> dict[Path, Scalar]:
        folders = {}
        for item in _texts(self.node.get(key)):
            folder = package_data.registry() if item.text == SHIPPED else path_of(self.root, item.text)
            if folder is None or not folder.is_dir():
                self._tell(item.span, "missing-file", f"there is no folder '{item.text}'", hint)
            else:
                folders[folder] = item
        return folders

    def _files(self, node: Node | None) -> tuple[Path, ...]:
        files = []
        for item in _texts(node):
            path = path_of(self.root, item.text)
            if path is not None and path.is_file():
                files.append(self.root / item.text)
            else:
                self._tell(item.span, "missing-file", f"there is no file '{item.text}'", _FROM_HERE)
        return tuple(files)

    def _paths(self) -> tuple[str, ...]:
        paths = []
        for item in _texts(self.node.get("paths")):
            path = posixpath.normpath(os.path.expanduser(item.text))  # noqa: PTH111  (it never raises)
            if not path.startswith("/") or path.strip("/") == "":
                message = f"'{item.text}' is not the whole path of a file or folder"
                self._tell(item.span, "wrong-value", message, "for example /etc/ros")
            else:
                paths.append(path)
        return tuple(paths)

    def _check_messages(self, files: tuple[Path, ...]) -> None:
        if not files:
            return
        from dodo_dsl.opendlv.message_set import MessageSet  # slow to load, and rarely needed
        from dodo_dsl.opendlv.odvd import OdvdError

        try:
            MessageSet.load(*files)
        except OdvdError as error:
            place = _ODVD_PLACE.fullmatch(str(error))
            span, text = self.node.entries["messages"].key, str(error)
            if place:
                span, text = Span(place["file"], int(place["line"] or 1), int(place["column"] or 1)), place["text"]
            self._tell(span, "wrong-messages", text)

    def _check_types(self, files: tuple[Path, ...]) -> None:
        if not files:
            return
        from dodo_dsl.opendlv.ros_codec import Codec, RosTypeError

        try:
            Codec(files)
        except RosTypeError as error:
            self._tell(self.node.entries["messages"].key, "wrong-messages", str(error))

    def _rigs(self) -> dict[str, Rig]:
        rigs: dict[str, Rig] = {}
        taken: dict[int | None, str] = {}
        for name, written in entries(self.node, "rigs").items():
            assert isinstance(written.value, Mapping)
            raw = plain(written.value)
            cid = None if raw.get("emulated") else raw.get("cid", _NO_CID)
            found = rigs[name] = Rig(name, raw.get("kind", "dynamic"), cid, written.value)
            if cid is not None and name in rig.EMULATED_RIGS:
                message = f"the name '{name}' is reserved for the built-in rig"
                self._tell(written.key, "wrong-value", message, "choose another name")
            elif cid not in (None, _NO_CID) and (cid in taken or cid in RESERVED_CIDS):
                owner = f"rig '{taken[cid]}'" if cid in taken else "real cars"
                message = f"CID {cid} is taken by {owner}, expected one that only this rig has"
                self._tell(written.value.entries["cid"].value.span, "rig-cid", message)
            taken.setdefault(cid, name)
            for item in _texts(written.value.get("tags")):
                if item.text in rig.RESERVED_TAGS - {*rig.KIND_TAGS[found.kind]}:
                    message = f"'{item.text}' is the tag of other runners, those of rig '{name}' have '{found.tag}'"
                    self._tell(item.span, "wrong-value", message, "remove it, or choose the rig's own tag")
        return rigs

    def _cids(self) -> tuple[int, ...]:
        written = self.node.get("cids")
        if not isinstance(written, Scalar):
            return Deployment.cids
        low, high = (int(part) for part in written.text.split("-"))
        if not 1 <= low <= high <= 254:
            message = f"'{written.text}' is not a range of CIDs, expected numbers from 1 to 254, the lower one first"
            self._tell(written.span, "out-of-range", message)
            return Deployment.cids
        return tuple(cid for cid in range(low, high + 1) if cid not in RESERVED_CIDS)

    def _subnets(self) -> ipaddress.IPv4Network:
        written = self.node.get("subnets")
        if not isinstance(written, Scalar):
            return DEFAULT_SUBNETS
        try:
            network = ipaddress.IPv4Network(written.text)
        except ValueError as error:
            self._tell(written.span, "wrong-value", f"not an IPv4 network: {error}", "for example 10.213.0.0/16")
            return DEFAULT_SUBNETS
        if network.prefixlen > 28:
            self._tell(written.span, "out-of-range", f"'{written.text}' is too small, every test needs a /28")
            return DEFAULT_SUBNETS
        return network


def _sandbox(node: Node | None) -> SandboxLimits:
    raw = values(node, schema_of_keys("deployment")["properties"]["sandbox"]) if node else {}
    reads, cpus = tuple(raw.pop("read", ())), raw.pop("cpus", None)
    return SandboxLimits(reads=reads, cpus=cpus, **{key.replace("-", "_"): int(value) for key, value in raw.items()})
