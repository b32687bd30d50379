"""The application as it is written: its services, their variables, and the messages that they produce and consume."""

import functools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl import source
from dodo_dsl.application.compose_files import Statements, is_late, variables_in
from dodo_dsl.application.host_paths import HostPaths, repository
from dodo_dsl.application.interpolation import literal
from dodo_dsl.application.merge import NAMESPACES
from dodo_dsl.application.opendlv_flags import split
from dodo_dsl.application.ros_topics import RosTopic, Word, ros_topics
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Node, Scalar
from dodo_dsl.spec.sandbox_limits import SandboxLimits

SANDBOX = "sandbox"
FILES = "dodo-files"
"""The service that copies the files of the repository to which an application may write."""
KEYS = ("x-dodo", "x-dodo-process")
OFFSCREEN = {"QT_QPA_PLATFORM": "offscreen"}
"""The variable by which programs that draw with Qt need no display."""
COMMANDS = ("x-dodo-process", "entrypoint", "command")
_FALSE = ("false", "f", "0", "no", "n", "off", "")

_ABOUT_NO_MESSAGES = {"tune", "cid", "display"}


@dataclass(frozen=True)
class Access:
    """What a test's application may use of its host.

    ``roots`` are folders whose files are the application's own, besides those of its repository, ``paths`` others that
    it may mount, ``passed`` variables of DoDo's own environment. ``outside`` says whether it may reach other networks.
    ``ports`` are those of the deployment's rigs: it gets none.
    """

    roots: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    passed: tuple[str, ...] = ()
    outside: bool = False
    ports: tuple[str, ...] = ()


@dataclass(frozen=True)
class PrintedLine:
    """A pattern, and the message under a sender stamp that a line becomes in which it is found, with their places."""

    match: str
    match_span: Span
    message: str
    message_span: Span
    sender: int = 0
    sample_time: str = "us"
    take: str = "all"

    @property
    def port(self) -> str:
        return f"{self.message}/{self.sender}" if self.sender else self.message


@dataclass(frozen=True)
class Declared:
    """``x-dodo`` of a service; a message is ``name`` or ``name/senderStamp`` with its place. ``readers`` may be 0.

    ``outputs`` are also those of ``lines``, and what topics of ``ros`` become.
    """

    inputs: tuple[Word, ...]
    outputs: tuple[Word, ...]
    answers: tuple[Word, ...]
    done: Word | None
    readers: int
    span: Span
    lines: tuple[PrintedLine, ...] = ()
    topics: tuple[RosTopic, ...] = ()


@dataclass(frozen=True)
class EnvFile:
    """A path of ``env_file`` with its place; ``required`` is False if compose starts without the file.

    ``raw`` is the format whose values are as they are written. ``statements`` are what the file sets, ``problems`` what
    compose refuses in it.
    """

    path: str
    span: Span
    required: bool
    raw: bool
    statements: Statements
    problems: Sequence[Diagnostic]


@dataclass(frozen=True)
class ComposeService:
    """A service of the application that starts, with its place; paths in ``node`` are relative to the compose file.

    ``declared`` is None without x-dodo, or if that says nothing of messages. Variables are filled in but for those in
    ``raw``, the values of TEST_FILLED as they are written.
    """

    name: str
    node: source.Mapping
    span: Span
    declared: Declared | None
    env_files: tuple[EnvFile, ...] = ()
    raw: Mapping[str, Node] = field(default_factory=dict)

    @functools.cached_property
    def words(self) -> tuple[tuple[str, Scalar], ...]:
        return tuple(word for key in COMMANDS for word in words_of(self.node.get(key)))

    @functools.cached_property
    def file_variables(self) -> Mapping[str, str | None]:
        """The variables that its files set; None takes the value from outside."""
        return {name: value for file in self.env_files for name, value in file.statements}

    @property
    def has_display(self) -> bool:
        display = source.part(self.node, KEYS[0], "display")
        return isinstance(display, Scalar) and display.value is True


@dataclass(frozen=True)
class ApplicationSource:
    """The merged compose files, which are all that rules and the planner see of the application.

    ``services`` are those that start, by name. Paths are relative to ``folder``. ``dropped`` has the reasons why
    services do not start, by name, ``shown`` the paths of the host that it asks for, and ``secrets`` the
    files that set variables which no compiled test holds. ``known`` are all variables whose values are known,
    ``access`` is what the deployment allows, ``limits`` are the highest that the services may set. ``cids`` are
    declared to be built in, all the same one. ``top`` has all top-level keys.
    """

    path: Path
    services: Mapping[str, ComposeService]
    dropped: Mapping[str, str] = field(default_factory=dict)
    shown: tuple[tuple[str, Span, str], ...] = ()
    secrets: Mapping[str, Path] = field(default_factory=dict)
    known: Mapping[str, str] = field(default_factory=dict)
    access: Access = field(default_factory=Access)
    limits: SandboxLimits = field(default_factory=SandboxLimits)
    top: Mapping[str, source.Entry] = field(default_factory=dict)
    cids: tuple[Scalar, ...] = ()

    @property
    def rest(self) -> Mapping[str, Node]:
        return {key: entry.value for key, entry in self.top.items() if key in ("volumes", "secrets", "configs")}

    @functools.cached_property
    def demanding(self) -> tuple[tuple[str, str, Scalar], ...]:
        """The values that may require a variable (``${NAME:?why}``), each with its service, if any, and its key."""
        own = [(n, key, s.raw.get(key, e.value)) for n, s in self.services.items() for key, e in s.node.entries.items()]
        found = [*own, *(("", key, node) for key, node in self.rest.items())]
        return tuple(
            (name, key, part)
            for name, key, node in found
            for part in source.walk(node)
            if isinstance(part, Scalar) and isinstance(part.value, str) and "?" in part.value and "${" in part.value
        )

    def is_late(self, name: str) -> bool:
        return is_late(name, (*self.access.passed, *self.secrets))

    @property
    def cid(self) -> int | None:
        values = [cid.value for cid in self.cids if isinstance(cid.value, int)]
        return values[0] if values else None

    @functools.cached_property
    def paths(self) -> HostPaths:
        roots = (*repository(self.folder), *self.other_roots)
        return HostPaths(self.folder, roots, tuple(map(Path, self.access.paths)))

    @functools.cached_property
    def other_roots(self) -> tuple[Path, ...]:
        own = repository(self.folder)
        return tuple(root for root in map(Path, self.access.roots) if root not in own)

    @property
    def folder(self) -> Path:
        return self.path.parent

    @property
    def declared(self) -> Mapping[str, Declared | None]:
        return {
            name: service.declared or (Declared((), (), (), None, 0, service.span) if self.speaks_ros else None)
            for name, service in self.services.items()
        }

    @property
    def speaks_ros(self) -> bool:
        return any(service.declared and service.declared.topics for service in self.services.values())


def is_true(value: object) -> bool:
    return value is True or (isinstance(value, str) and value.strip().lower() not in _FALSE)


def references(service: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for key in NAMESPACES:
        kind, _, name = str(service.get(key)).partition(":")
        if kind == "service":
            yield key, name
    for key, prefix in (("volumes_from", "service:"), ("links", "")):
        names = (str(entry).removeprefix(prefix).partition(":")[0] for entry in service.get(key) or ())
        yield from ((key, name) for name in names if name != "container")
    for name, options in (service.get("depends_on") or {}).items():
        if not isinstance(options, dict) or options.get("required") is not False:
            yield "depends_on", name


def plain(node: Node) -> Any:
    """As ``source.plain``, with numbers as compose reads them: ``0440`` is octal."""
    if isinstance(node, source.Mapping):
        return {key: plain(entry.value) for key, entry in node.entries.items()}
    if isinstance(node, source.Sequence):
        return [plain(item) for item in node.items]
    return _number(node.value, node.text) if isinstance(node.value, int) else node.value


def _number(value: int, written: str) -> int | float:
    """A whole number; beyond 64 bits a float, as for compose."""
    if written[:1] == "0" and set(written) <= set("01234567"):
        value = int(written, 8)
    return value if -(1 << 63) <= value < 1 << 64 else float(value)


def text(value: object) -> str:
    """A YAML value as compose writes it into a container's environment."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def environment(raw: Any) -> dict[str, str | None]:
    """``environment`` with texts; None takes the value from DoDo's own environment."""
    return {name: None if value is None else text(value) for name, value in (raw or {}).items()}


def words_of(node: Node | None) -> Iterator[tuple[str, Scalar]]:
    """The words of one command; none of a text that compose cannot split."""
    for item in node.items if isinstance(node, source.Sequence) else (node,):
        if isinstance(item, Scalar):
            try:
                words = (text(item.value),) if item is not node else split(item.text)
            except ValueError:
                words = ()
            yield from ((word, item) for word in words)


def declared_cid(node: source.Mapping) -> Scalar | None:
    cid = source.part(node, "x-dodo", "cid")
    return cid if isinstance(cid, Scalar) else None


def declared(service: source.Mapping) -> Declared | None:
    entry = service.entries.get("x-dodo")
    if entry is None or not isinstance(entry.value, source.Mapping):
        return None
    if entry.value.entries and entry.value.entries.keys() <= _ABOUT_NO_MESSAGES:
        return None
    words = {key: tuple((s.text, s.span) for s in scalars(e.value)) for key, e in entry.value.entries.items()}
    inputs, outputs, answers, done = (words.get(key, ()) for key in ("in", "out", "answers", "done"))
    readers = entry.value.get("readers")
    count = readers.value if isinstance(readers, Scalar) and isinstance(readers.value, int) else 0
    lines = tuple(printed_lines(entry.value.get("lines")))
    topics = tuple(ros_topics(entry.value.get("ros")))
    outputs += tuple(word for topic in topics if not topic.given for word in topic.messages)
    sent = {name.removesuffix("/0") for name, _ in outputs}
    printed = {line.port: (line.port, line.message_span) for line in lines if line.port not in sent}
    outputs += tuple(printed.values())
    return Declared(inputs, outputs, answers, done[0] if done else None, count, entry.key, lines, topics)


_LINE_KEYS = ("sample-time", "take")


def printed_lines(node: Node | None) -> Iterator[PrintedLine]:
    """The ``lines`` of a service, as far as they fit the schema; ``$$`` is a dollar sign, as everywhere in compose."""
    for item in node.items if isinstance(node, source.Sequence) else ():
        match, message, sender = (source.part(item, key) for key in ("match", "message", "sender"))
        if isinstance(match, Scalar) and isinstance(message, Scalar):
            stamp = sender.value if isinstance(sender, Scalar) and isinstance(sender.value, int) else 0
            unit, take = (each.text if isinstance(each := source.part(item, key), Scalar) else "" for key in _LINE_KEYS)
            pattern = match.text.replace("$$", "$")
            yield PrintedLine(pattern, match.span, message.text, message.span, stamp, unit or "us", take or "all")


def scalars(node: Node | None) -> list[Scalar]:
    nodes = node.items if isinstance(node, source.Sequence) else (node,)
    return [n for n in nodes if isinstance(n, Scalar) and isinstance(n.value, str)]


def image_variable(service: str) -> str:
    return "DODO_IMAGE_" + re.sub(r"[^A-Z0-9_]", "_", service.upper())


def env_files(service: source.Mapping, folder: Path) -> Iterator[EnvFile]:
    node = service.get("env_file")
    for item in node.items if isinstance(node, source.Sequence) else ():
        path, required, kind = (source.part(item, key) for key in ("path", "required", "format"))
        if isinstance(path, Scalar) and isinstance(path.value, str):
            is_required = not isinstance(required, Scalar) or is_true(required.value)
            text = literal(path.text) or path.text
            raw = isinstance(kind, Scalar)
            yield EnvFile(text, path.span, is_required, raw, *variables_in(folder / text, raw=raw))


def with_entry(node: source.Mapping, key: str, value: Node) -> source.Mapping:
    """The node with another value of a key, which stands where the value does if it is new."""
    place = node.entries[key].key if key in node.entries else value.span
    return source.Mapping(node.span, {**node.entries, key: source.Entry(place, value)}, node.tag)
