"""What keys and values mean that are almost right: misspelt words, missing spaces, indentation."""

import math
import re
from collections.abc import Collection
from typing import Any

import yaml

from dodo_dsl.diagnostics import closest, did_you_mean
from dodo_dsl.source import Entry, entries

_WORDS = {"yes": "true", "y": "true", "on": "true", "no": "false", "n": "false", "off": "false"}
_CLOSING = {"{": "}", "[": "]"}


def boolean_meant(text: str) -> str:
    """A hint for a word that other readers of YAML take for true or false; empty for others."""
    meant = _WORDS.get(text.lower(), "")
    return f"write {meant}" if meant else ""


_SPACE_MISSING = re.compile(r"(?P<key>[^:\s]+):(?P<value>.*\S.*)", re.DOTALL)
"""A key in text that is YAML nonetheless, as ``{uses:camera}`` is."""


def unknown_key(word: str, known: Collection[str]) -> tuple[str, str]:
    """What is wrong with an unknown key beside others, empty for a misspelt one, and a hint."""
    if (found := _SPACE_MISSING.fullmatch(word)) and found["key"] in known:
        key, value = found["key"], found["value"].strip()
        return f"a space is missing after the colon of '{key}'", _write(key, value)
    return "", did_you_mean(word, known)


def meant(word: str, known: Collection[str]) -> str:
    """The known key that an unknown one most likely means; empty when there is none."""
    return next(iter(closest(word.partition(":")[0], known)), "")


def _write(key: str, value: str) -> str:
    closing = _CLOSING.get(value[0], "")
    if closing not in value:  # the key ends at the first colon within the brackets
        value = f"{value[0]}...{closing}"
    return f"write '{key}: {value if len(value) <= 60 else f'{value[:57]}...'}'"


def in_line(value: object) -> str:
    text = str(yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=math.inf))
    return text.strip().removesuffix("\n...")


def to_write(key: str, schema: dict[str, Any]) -> str:
    """A hint for a key that is missing: ``write 'kind: closed-loop'``."""
    first = (schema.get("examples") or schema.get("enum") or [schema.get("const")])[0]
    others = [in_line(other) for other in schema.get("enum", ()) if other != first]
    more = f", or {', '.join(others)}" if others else ""
    return f"write '{key}: {in_line(first)}'{more}" if first is not None else ""


def schema_at(schema: dict[str, Any], key: str) -> dict[str, Any]:
    found = schema.get("properties", {}).get(key) or schema.get("additionalProperties")
    return found if isinstance(found, dict) else {}


def home(key: str, beside: dict[str, Entry], schema: dict[str, Any]) -> str:
    """Where a key of a mapping with this ``schema`` belongs that may be indented too little; empty for others."""
    here = beside[key]
    above = next((name for name, each in reversed(beside.items()) if each.key.line < here.key.line), "")
    below = schema_at(schema, above)
    services = below.get("additionalProperties")
    known = below.get("properties") or (services.get("properties", {}) if isinstance(services, dict) else {})
    fits = key in known or not known.keys().isdisjoint(entries(here.value))
    return f"indent it if it belongs to '{above}'" if fits and above else ""
