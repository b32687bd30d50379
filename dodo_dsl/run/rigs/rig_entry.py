"""Values written into a rig's entry of ``dodo.yml``, in place: comments, order and all else stay as they are."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl import atomic
from dodo_dsl.run.rigs.axis_calibration import CalibrationProblem
from dodo_dsl.source import parse, plain

Path_ = tuple[str, ...]
Values = Mapping[Path_, str]
"""Scalars, or flow collections, as YAML, by the keys that lead to them within the rig."""


class NotWritten(CalibrationProblem):
    """The file cannot be changed without a change of something else; says what to write by hand."""


def write(file: Path, rig: str, values: Values) -> None:
    """Sets values of a rig in the file, all or none; raises NotWritten and OSError."""
    target = file.resolve()
    try:
        text = target.read_bytes().decode()
    except UnicodeDecodeError:
        raise NotWritten(f"{file} is not in UTF-8; {_by_hand(rig, values)}") from None
    atomic.write_text(target, changed(text, rig, values), durable=True)


def changed(text: str, rig: str, values: Values) -> str:
    """The file's text with the values set; raises NotWritten."""
    wanted = _plain(text)
    new = text
    try:
        for path, value in values.items():
            _set(wanted["rigs"][rig], path, _plain(value))
            new = _with(new, ("rigs", rig, *path), value)
        same = _plain(new) == wanted
    except (_NoPlace, yaml.YAMLError, KeyError, TypeError):
        same = False
    if not same:
        raise NotWritten(f"the rig's entry cannot be changed without a change of others; {_by_hand(rig, values)}")
    return new


class _NoPlace(Exception):
    """A key does not lead to its own mapping."""


def _by_hand(rig: str, values: Values) -> str:
    written: dict[str, Any] = {}
    for path, value in values.items():
        _set(written, path, _plain(value))
    text = yaml.safe_dump(written, default_flow_style=True, sort_keys=False, width=10_000).strip()[1:-1]
    return f"write below 'rigs: {rig}:' by hand: {text}"


def _plain(text: str) -> Any:
    node, problems = parse(text, "")
    if node is None or problems:
        raise _NoPlace
    return plain(node)


def _set(tree: dict[str, Any], path: Path_, value: Any) -> None:
    for key in path[:-1]:
        tree = tree.setdefault(key, {})
        if not isinstance(tree, dict):
            raise _NoPlace
    tree[path[-1]] = value


def _with(text: str, path: Path_, value: str) -> str:
    node: Any = yaml.compose(text, Loader=yaml.SafeLoader)
    for depth, key in enumerate(path):
        if not isinstance(node, yaml.MappingNode):
            raise _NoPlace
        entry = next(((k, v) for k, v in node.value if k.value == key), None)
        if entry is None:
            return _inserted(text, node, path[depth:], value)
        name, node = entry
        if node.start_mark.index < name.end_mark.index:  # an alias
            raise _NoPlace
    begin, end = node.start_mark.index, _end(node)
    if not isinstance(node, yaml.ScalarNode) and "#" in text[begin:end]:
        raise _NoPlace
    return text[:begin] + value + text[end:]


def _inserted(text: str, node: Any, keys: Path_, value: str) -> str:
    """A new entry at the end of a mapping."""
    for key in reversed(keys[1:]):
        value = f"{{{key}: {value}}}"
    entry = f"{keys[0]}: {value}"
    newline = "\r\n" if "\r\n" in text else "\n"
    if node.flow_style:
        return _inserted_in_flow(text, node, entry, newline if len(keys) > 1 else "")
    at = _end(node)
    if text[at - 1 : at] != "\n":
        line_end = text.find("\n", at)
        if line_end < 0:
            text += newline
            line_end = len(text) - 1
        at = line_end + 1
    indent = " " * int(node.value[0][0].start_mark.column)
    return f"{text[:at]}{indent}{entry}{newline}{text[at:]}"


def _inserted_in_flow(text: str, node: Any, entry: str, newline: str) -> str:
    """With a newline, the entry gets its own line, below the one with the mapping's start."""
    if not node.value:
        at = node.end_mark.index - 1
        return f"{text[:at]}{entry}{text[at:]}"
    at = _end_of(*node.value[-1])
    line = text[text.rfind("\n", 0, node.start_mark.index) + 1 :]
    between = newline + " " * (len(line) - len(line.lstrip(" ")) + 2) if newline else " "
    return f"{text[:at]},{between}{entry}{text[at:]}"


def _end(node: Any) -> int:
    """Where a node's text ends: PyYAML's mark of a block is at what comes next."""
    if isinstance(node, yaml.ScalarNode) or node.flow_style or not node.value:
        return int(node.end_mark.index)
    if isinstance(node, yaml.MappingNode):
        return _end_of(*node.value[-1])
    return _end(node.value[-1])


def _end_of(key: Any, value: Any) -> int:
    return max(int(key.end_mark.index), _end(value) if value.start_mark.index >= key.end_mark.index else 0)
