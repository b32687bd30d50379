"""Values as YAML that readers of 1.1 and 1.2 take for the same: block style, and on one line what fits there."""

import functools
import re
from collections.abc import Iterator, Mapping
from typing import Any

from dodo_dsl.plan.plan_json import json_text

_WIDTH = 100
_PLAIN = re.compile(r"(?:[A-Za-z/]|--|\.{1,2}/)(?:[A-Za-z0-9_./=@+$-]|:(?=[^ ])| (?=[^ ]))*(?<![: ])")
_WORDS = ("true", "false", "yes", "no", "on", "off", "y", "n", "null")
"""What YAML 1.1 takes for something else than a string."""
_UNPRINTABLE = re.compile("[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff]")


class Alias(str):
    """The name of an anchor: a key ``x-NAME`` of the whole has the anchor ``NAME``."""


def text(value: Mapping[str, Any]) -> str:
    return "".join(f"{line}\n" for line in _lines(value, "", True))


def _lines(value: Mapping[str, Any], pad: str, is_whole: bool = False) -> Iterator[str]:
    for key, below in value.items():
        anchor = f" &{key[2:]}" if is_whole and key.startswith("x-") else ""
        head = f"{pad}{_key(key, below)}:{anchor}"
        line = f"{head} {flow(below)}"
        if is_whole and pad == "" and isinstance(below, Mapping) and below:
            yield from ("", head)
            yield from _lines(below, "  ")
        elif len(line) <= _WIDTH or not isinstance(below, Mapping | list | tuple):
            yield line
        elif isinstance(below, Mapping):
            yield head
            yield from _lines(below, f"{pad}  ")
        else:
            yield head
            yield from (f"{pad}  - {flow(item)}" for item in below)


def flow(value: Any) -> str:
    if isinstance(value, Alias):
        return f"*{value}"
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, Mapping):
        pairs = (f"{_key(key, each)}: {flow(each)}" for key, each in value.items())
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(flow, value))}]"
    return json_text(value)


def _key(key: str, below: Any) -> str:
    return key if isinstance(below, Alias) else _string(key)


@functools.lru_cache(maxsize=10_000)
def _string(value: str) -> str:
    if _PLAIN.fullmatch(value) and value.lower() not in _WORDS:
        return value
    return _UNPRINTABLE.sub(lambda found: f"\\u{ord(found[0]):04x}", json_text(value))
