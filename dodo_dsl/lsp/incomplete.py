"""Where the cursor is in a text that is being written, and so most often no YAML."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import yaml

from dodo_dsl.lsp.tree import Steps, below
from dodo_dsl.source import Mapping, Scalar, parse

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_MARK = "xCursorx"
_WORD = re.compile(r"(?:\$\{[\w.-]*|[^\s,{}\[\]\"':]*)\Z")
_MAX_TEXT = 1 << 20


@dataclass(frozen=True)
class Cursor:
    """The keys that lead to a word that is being written.

    ``word`` begins at ``start`` in the text; ``before`` is what its value has before it, as ``10`` in ``10 H``. For a
    key, ``steps`` end with the mapping, whose other keys are ``keys``. ``values`` has scalars by their steps: those
    before it, and those beside the keys that lead to it.
    """

    steps: Steps
    is_key: bool
    word: str
    start: int
    before: str = ""
    keys: tuple[str, ...] = ()
    values: dict[Steps, str] = field(default_factory=dict)


@dataclass
class _Open:
    """A collection whose end has not been read yet."""

    is_mapping: bool
    is_flow: bool
    key: str | None = None
    line: int = 0
    keys: list[str] = field(default_factory=list)
    index: int = 0

    def step(self) -> str | int | None:
        return self.key if self.is_mapping else self.index

    def filled(self) -> None:
        """The value at the step is complete."""
        self.key = None
        self.index += 1


def cursor(text: str, offset: int) -> Cursor | None:
    """The cursor at an index of the text; None where nothing can be said of it."""
    head = text[: min(offset, _MAX_TEXT)]
    match = _WORD.search(head)
    word = match[0] if match else ""
    start = len(head) - len(word)
    if head[:start].endswith(":"):
        return None  # a value begins after a space
    for ending in ("", ": "):
        if found := _read(head[:start] + _MARK + ending, word, start):
            return _with_rest(found, head[:start], text[offset:])
    return None


def _with_rest(found: Cursor, head: str, tail: str) -> Cursor:
    """The cursor with what stands behind it, where the text is YAML but for the word."""
    ending = ": " if found.is_key and not tail.startswith(":") else ""
    root, _ = parse(head + _MARK + ending + tail, "")
    values, keys = dict(found.values), found.keys
    for depth in range(len(found.steps) + 1):
        node = below(root, *map(str, found.steps[:depth]))
        if isinstance(node, Mapping):
            scalars = {key: entry.value for key, entry in node.entries.items() if isinstance(entry.value, Scalar)}
            values |= {(*found.steps[:depth], key): scalar.text for key, scalar in scalars.items() if key != _MARK}
            if depth == len(found.steps):
                keys = tuple(key for key in node.entries if key != _MARK)
    return replace(found, keys=keys, values=values)


def _read(text: str, word: str, start: int) -> Cursor | None:
    stack: list[_Open] = []
    values: dict[Steps, str] = {}
    for event in _events(text):
        if isinstance(event, yaml.MappingStartEvent | yaml.SequenceStartEvent):
            stack.append(_Open(isinstance(event, yaml.MappingStartEvent), bool(event.flow_style)))
        elif isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
            stack.pop()
            if stack:
                stack[-1].filled()
        elif isinstance(event, yaml.ScalarEvent):
            if event.value.endswith(_MARK):
                return _found(stack, event, Cursor((), True, word, start, values=values))
            _scalar(stack, event, values)
        elif isinstance(event, yaml.AliasEvent) and stack:
            stack[-1].filled()
    return None


def _events(text: str) -> Iterator[Any]:
    """The events of a text up to where it is no YAML."""
    try:
        yield from yaml.parse(text, Loader=_LOADER)
    except (yaml.YAMLError, ValueError):
        return


def _steps(stack: list[_Open]) -> Steps:
    return tuple(step for one in stack if (step := one.step()) is not None)


def _scalar(stack: list[_Open], event: Any, values: dict[Steps, str]) -> None:
    if not stack:
        return
    top = stack[-1]
    if top.is_mapping and top.key is None:
        top.key, top.line = event.value, event.start_mark.line
        top.keys.append(event.value)
    else:
        values[_steps(stack)] = event.value
        top.filled()


def _found(stack: list[_Open], event: Any, about: Cursor) -> Cursor:
    top = stack[-1] if stack else None
    steps = _steps(stack)
    if top is None or (top.is_mapping and top.key is None):
        return Cursor(steps, True, about.word, about.start, keys=tuple(top.keys if top else ()), values=about.values)
    begins_mapping = top.is_mapping and not top.is_flow and event.start_mark.line > top.line
    if begins_mapping:
        return Cursor(steps, True, about.word, about.start, values=about.values)
    before = event.value.removesuffix(_MARK).strip()
    return Cursor(steps, False, about.word, about.start, before, values=about.values)
