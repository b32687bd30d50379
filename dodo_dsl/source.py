"""YAML read with positions: every key and every value keeps its line and column.

Plain scalars follow the core schema of YAML 1.2 (``on`` and ``yes`` are strings). The parser works on events,
without recursion, so that nesting, size and aliases of hostile files are bounded before anything is built.
"""

import codecs
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl.diagnostics import Diagnostic, Span

MAX_BYTES = 1 << 20
MAX_DEPTH = 32
MAX_NODES = 20_000
MAX_PROBLEMS = 500

Plain = str | int | float | bool | None

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INT = re.compile(r"[-+]?[0-9]{1,300}\Z|0o[0-7]{1,300}\Z|0x[0-9a-fA-F]{1,300}\Z")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?\Z")
_DASHES = re.compile(r"-[^-\s]\S*(\s+- ?[^-\s]\S*)+")
"""Items of a list that would be one text."""
_SECOND = "remove the line, or write what stands below into its own file"
_SPECIAL: dict[str, Plain] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".inf", ".Inf", ".INF", "+.inf"), float("inf")),
    "-.inf": float("-inf"),
    ".nan": float("nan"),
}


@dataclass(frozen=True, slots=True)
class Scalar:
    """A scalar: ``value`` as YAML 1.2 resolves it, ``text`` as it was written."""

    span: Span
    value: Plain
    text: str
    tag: str = ""


@dataclass(frozen=True, slots=True)
class Sequence:
    span: Span
    items: tuple["Node", ...]
    tag: str = ""


@dataclass(frozen=True, slots=True)
class Entry:
    """The place of a key, and its value."""

    key: Span
    value: "Node"


@dataclass(frozen=True, slots=True)
class Mapping:
    span: Span
    entries: dict[str, Entry]
    tag: str = ""

    def get(self, key: str) -> "Node | None":
        entry = self.entries.get(key)
        return entry.value if entry else None


Node = Scalar | Sequence | Mapping
Reader = Callable[[Path], tuple[Node | None, list[Diagnostic]]]
"""``read``, or what reads the text of an editor in place of a file's."""


def plain(node: Node) -> Any:
    if isinstance(node, Mapping):
        return {key: plain(entry.value) for key, entry in node.entries.items()}
    if isinstance(node, Sequence):
        return [plain(item) for item in node.items]
    return node.value


def part(node: Node | None, *keys: str) -> Node | None:
    """The value below keys, each of the mapping before; None where there is none."""
    for key in keys:
        node = node.get(key) if isinstance(node, Mapping) else None
    return node


def entries(node: Node | None, *keys: str) -> dict[str, Entry]:
    """The entries of the mapping below keys; none where there is no mapping."""
    found = part(node, *keys)
    return found.entries if isinstance(found, Mapping) else {}


def walk(node: Node) -> Iterator[Node]:
    waiting = [node]
    while waiting:
        one = waiting.pop()
        yield one
        if isinstance(one, Mapping):
            waiting.extend([entry.value for entry in one.entries.values()][::-1])
        elif isinstance(one, Sequence):
            waiting.extend(one.items[::-1])


def resolve(text: str) -> Plain:
    """A plain scalar's value in the core schema of YAML 1.2 (section 10.3.2)."""
    if text in _SPECIAL:
        return _SPECIAL[text]
    if _INT.match(text):
        return int(text, 0) if text[:2] in ("0o", "0x") else int(text)
    return float(text) if _FLOAT.match(text) else text


class _Stop(Exception):
    def __init__(self, span: Span, rule: str, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.diagnostic = Diagnostic(span, rule, message, hint)


@dataclass
class _Open:
    """A collection whose end has not been read yet."""

    span: Span
    tag: str
    anchor: str | None
    is_mapping: bool
    weight: int = 1
    depth: int = 1
    items: list[Node] = field(default_factory=list)
    entries: dict[str, Entry] = field(default_factory=dict)
    merged: list[Node] = field(default_factory=list)
    key: Scalar | None = None


class _Builder:
    def __init__(self, file: str) -> None:
        self.file = file
        self.stack: list[_Open] = []
        self.root: Node | None = None
        self.anchors: dict[str, tuple[Node, int, int]] = {}
        self.count = 0
        self.documents = 0
        self.diagnostics: list[Diagnostic] = []

    def span(self, event: Any) -> Span:
        start, end = event.start_mark, event.end_mark
        length = end.column - start.column if end.line == start.line else 1
        return Span(self.file, start.line + 1, start.column + 1, max(1, length))

    def report(self, span: Span, rule: str, message: str, hint: str = "") -> None:
        self.diagnostics.append(Diagnostic(span, rule, message, hint))
        if len(self.diagnostics) == MAX_PROBLEMS:
            raise _Stop(span, "too-large", f"{MAX_PROBLEMS} problems found, the rest of the file is not read")

    def feed(self, event: Any) -> None:
        if isinstance(event, yaml.ScalarEvent):  # most events are
            self._scalar(event)
        elif isinstance(event, yaml.CollectionStartEvent):
            self._open(event)
        elif isinstance(event, yaml.CollectionEndEvent):
            self._close()
        elif isinstance(event, yaml.AliasEvent):
            self._alias(event)
        elif isinstance(event, yaml.DocumentStartEvent):
            self.documents += 1
            if self.documents > 1:
                raise _Stop(self.span(event), "yaml-syntax", "a second YAML document, expected one per file", _SECOND)

    def _grow(self, span: Span, weight: int) -> None:
        self.count += weight
        if self.count > MAX_NODES:
            raise _Stop(span, "too-large", f"more than {MAX_NODES} values, including those that aliases repeat")

    def _scalar(self, event: Any) -> None:
        span = self.span(event)
        is_plain = event.implicit[0]
        if is_plain and event.end_mark.line > event.start_mark.line and _DASHES.fullmatch(event.value):
            raise _Stop(span, "yaml-syntax", "a space is missing after '-'", f"write '- {event.value.split()[0][1:]}'")
        value = resolve(event.value) if is_plain else event.value
        self._add(Scalar(span, value, event.value, self._tag(event)), 1, event.anchor)

    @staticmethod
    def _tag(event: Any) -> str:
        return event.tag if event.tag and event.tag not in ("!", "tag:yaml.org,2002:str") else ""

    def _alias(self, event: Any) -> None:
        span = self.span(event)
        if event.anchor not in self.anchors:
            message = f"alias '*{event.anchor}' refers to an anchor that is missing or incomplete"
            raise _Stop(span, "yaml-syntax", message, "a text that begins with '*' needs quotes")
        node, weight, depth = self.anchors[event.anchor]
        self._check_depth(span, len(self.stack) + depth)
        self._add(node, weight, None, span, depth)

    @staticmethod
    def _check_depth(span: Span, depth: int) -> None:
        if depth > MAX_DEPTH:
            raise _Stop(span, "too-large", f"nested deeper than {MAX_DEPTH} levels, including aliases")

    def _open(self, event: Any) -> None:
        span = self.span(event)
        self._check_depth(span, len(self.stack) + 1)
        is_mapping = isinstance(event, yaml.MappingStartEvent)
        span = Span(span.file, span.line, span.column)
        self.stack.append(_Open(span, self._tag(event), event.anchor, is_mapping))

    def _close(self) -> None:
        top = self.stack.pop()
        node: Node
        if top.is_mapping:
            node = Mapping(top.span, self._with_merged(top), top.tag)
        else:
            node = Sequence(top.span, tuple(top.items), top.tag)
        self.count -= top.weight - 1
        self._add(node, top.weight, top.anchor, None, top.depth)

    def _with_merged(self, top: _Open) -> dict[str, Entry]:
        entries = dict(top.entries)
        for node in top.merged:
            for source in node.items if isinstance(node, Sequence) else (node,):
                if isinstance(source, Mapping):
                    entries = {**source.entries, **entries}
                else:
                    self.report(source.span, "yaml-syntax", "expected a mapping or a list of mappings after '<<'")
        return entries

    def _add(self, node: Node, weight: int, anchor: str | None, at: Span | None = None, depth: int = 0) -> None:
        span = at or node.span
        self._grow(span, weight)
        if anchor:
            self.anchors[anchor] = (node, weight, depth)
        if not self.stack:
            self.root = node
            return
        top = self.stack[-1]
        top.weight += weight
        top.depth = max(top.depth, depth + 1)
        if not top.is_mapping:
            top.items.append(node)
        elif top.key is None:
            top.key = self._as_key(node, span)
        else:
            self._entry(top, top.key, node)
            top.key = None

    def _as_key(self, node: Node, span: Span) -> Scalar:
        if isinstance(node, Scalar):
            return node
        message = "this key is a list or a mapping, expected a string"
        raise _Stop(span, "yaml-syntax", message, "remove the '?' or the brackets; a placeholder is \"${matrix.x}\"")

    def _entry(self, top: _Open, key: Scalar, node: Node) -> None:
        if key.text == "<<" and key.value == "<<":
            top.merged.append(node)
        elif key.text in top.entries:
            first = top.entries[key.text].key
            message = f"duplicate key '{key.text}', first defined in line {first.line}"
            self.report(key.span, "duplicate-key", message, "remove one of the two")
        else:
            top.entries[key.text] = Entry(key.span, node)


def _unreadable(file: str, text: str, error: Exception, problem: str) -> Diagnostic:
    """About a character that YAML does not allow, the first of its kind in the text."""
    code = int(getattr(error, "character", 0) or 0)
    position = max(text.find(chr(code)), 0)
    before = text[:position]
    span = Span(file, before.count("\n") + 1, position - (before.rfind("\n") + 1) + 1)
    if not isinstance(error, yaml.reader.ReaderError):
        return Diagnostic(span, "yaml-syntax", f"not YAML: {problem}")
    return Diagnostic(span, "yaml-syntax", f"the control character U+{code:04X} is not allowed here", "remove it")


def _syntax(file: str, text: str, error: Exception) -> Diagnostic:
    from dodo_dsl.slips import Failure, slip

    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    problem = str(getattr(error, "problem", "") or getattr(error, "reason", "") or error).splitlines()[0]
    if mark is None:
        return _unreadable(file, text, error, problem)
    begin, context = getattr(error, "context_mark", None), getattr(error, "context", None) or ""
    began = (begin.line, begin.column) if begin else None
    lines = text.splitlines()
    if found := slip(Failure(file, lines, problem, (mark.line, mark.column), context, began)):
        return found
    if begin and mark.line >= len(lines):  # what is never closed is shown where it is opened
        mark = begin
    where = f" {context} that begins in line {begin.line + 1}" if context and begin else ""
    hint = "look at brackets, quotes and indentation here and in the lines above"
    return Diagnostic(Span(file, mark.line + 1, mark.column + 1), "yaml-syntax", f"not YAML: {problem}{where}", hint)


def parse(text: str, file: str) -> tuple[Node | None, list[Diagnostic]]:
    """The document that a string holds, and its problems; None for an empty or unreadable one."""
    builder = _Builder(file)
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            builder.feed(event)
    except _Stop as stop:
        return None, [*builder.diagnostics, stop.diagnostic]
    except (yaml.YAMLError, ValueError) as error:
        return None, [*builder.diagnostics, _syntax(file, text, error)]
    return builder.root, builder.diagnostics


def path_of(folder: Path, text: str) -> Path | None:
    """The resolved path of a string; None if that is not a path: it contains NUL, is too long or is a symlink loop."""
    try:
        path = (folder / text).resolve()
        path.exists()
    except (OSError, RuntimeError, ValueError):
        return None
    return path


def read(path: Path) -> tuple[Node | None, list[Diagnostic]]:
    """As ``parse``, from a file; unreadable, oversized and non-UTF-8 files are diagnostics too."""
    file = str(path)
    try:
        if path.exists() and not path.is_file():
            return None, [Diagnostic(Span(file), "unreadable-file", "not a regular file")]
        with path.open("rb") as stream:
            raw = stream.read(MAX_BYTES + 1)
    except OSError as error:
        return None, [Diagnostic(Span(file), "unreadable-file", f"cannot read the file: {error.strerror}")]
    return parse_bytes(raw, file)


def parse_bytes(raw: bytes, file: str) -> tuple[Node | None, list[Diagnostic]]:
    if len(raw) > MAX_BYTES:
        return None, [Diagnostic(Span(file), "too-large", f"the file is larger than {MAX_BYTES // 1024} KiB")]
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return None, [Diagnostic(Span(file, length=0), "yaml-encoding", "the file is UTF-16", "save it as UTF-8")]
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        column = error.start - (raw.rfind(b"\n", 0, error.start) + 1) + 1
        return None, [Diagnostic(Span(file, line, column), "yaml-encoding", "the file is not UTF-8 from here on")]
    return parse(text, file)
