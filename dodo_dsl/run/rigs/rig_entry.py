"""A value written into a rig's entry of ``dodo.yml``, in place: comments, order and all else stay as they are."""

import json
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl import atomic
from dodo_dsl.run.rigs.calibration import CalibrationProblem


class NotWritten(CalibrationProblem):
    """The file cannot be changed without a change of something else; says what to write by hand."""


def write(file: Path, rig: str, keys: tuple[str, ...], value: dict[str, Any]) -> None:
    """Merges a mapping into the one that keys lead to within the rig; raises NotWritten and OSError."""
    target = file.resolve()
    atomic.write_text(target, changed(target.read_bytes().decode(), rig, keys, value), durable=True)


def changed(text: str, rig: str, keys: tuple[str, ...], value: dict[str, Any]) -> str:
    """The file's text with the mapping merged, which is written in one line; raises NotWritten."""
    wanted = _plain(text)
    entry = wanted["rigs"][rig]
    for key in keys[:-1]:
        entry = entry.setdefault(key, {})
    merged = entry[keys[-1]] = _merged(entry.get(keys[-1]) or {}, value)
    line = yaml.safe_dump(merged, default_flow_style=True, sort_keys=False, width=10_000).strip()
    new = _with(text, ("rigs", rig, *keys), line)
    if _plain(new) != wanted:
        by_hand = f"{'.'.join(keys)} of '{rig}' cannot be changed without a change of other lines"
        raise NotWritten(f"{by_hand}; write it by hand: {keys[-1]}: {line}")
    return new


def _plain(text: str) -> Any:
    """All values, each with its own: an alias stands for a copy. None for what is not YAML."""
    try:
        return json.loads(json.dumps(yaml.safe_load(text), default=str))
    except yaml.YAMLError:
        return None


def _merged(old: dict[str, Any], new: dict[str, Any]) -> dict[str, Any]:
    pairs = ((k, _merged(old.get(k) or {}, v) if isinstance(v, dict) else v) for k, v in new.items())
    return {**old, **dict(pairs)}


def _with(text: str, keys: tuple[str, ...], value: str) -> str:
    """The text with the value at the keys, of which only the last one may be missing; empty where it has no line."""
    node: Any = yaml.compose(text, Loader=yaml.SafeLoader)
    for depth, key in enumerate(keys):
        entry = next(((k, v) for k, v in node.value if k.value == key), None)
        if entry is not None:
            name, node = entry
            continue
        if depth < len(keys) - 1:
            return ""
        if node.flow_style:
            at = node.end_mark.index - 1
            return f"{text[:at]}{', ' if node.value else ''}{key}: {value}{text[at:]}"
        first = node.value[0][0].start_mark
        at = first.index
        return f"{text[:at]}{key}: {value}\n{' ' * first.column}{text[at:]}"
    begin = name.end_mark.index
    end = node.end_mark.index if node.flow_style else len(text[: node.end_mark.index].rstrip())
    return "" if "#" in text[begin:end] else f"{text[:begin]}: {value}{text[end:]}"
