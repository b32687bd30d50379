"""The manifest of a service as far as its command line needs it; the compiler validates manifests."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

About = Mapping[str, Any]
"""A manifest's entry for one parameter."""

COMMON: dict[str, About] = {
    "cid": {
        "type": "integer",
        "required": True,
        "minimum": 1,
        "maximum": 254,
        "example": 128,
        "help": "Session of the bus to join.",
    },
    "id": {
        "type": "integer",
        "default": 0,
        "minimum": 0,
        "maximum": 4_294_967_295,
        "help": "Sender stamp of messages, where no parameter sets another.",
    },
    "log-id": {
        "type": "integer",
        "minimum": 0,
        "maximum": 4_294_967_295,
        "help": "Sender stamp under which log lines are also sent as LogMessage; by default they are not.",
    },
    "verbose": {"type": "boolean", "default": False, "help": "Log more."},
}


def load_manifest(folder: Path) -> dict[str, Any]:
    """The service's own ``service.yml``."""
    manifest: dict[str, Any] = yaml.load((folder / "service.yml").read_text(encoding="utf-8"), _LOADER)  # noqa: S506
    return manifest


def parameters(manifest: Mapping[str, Any]) -> dict[str, About]:
    """All flags of a service, the common ones last."""
    return {**(manifest.get("parameters") or {}), **COMMON}


def unit(about: About) -> str:
    """`` Hz``, or nothing; shares, whose unit is 1, have none."""
    return "" if about.get("unit") in (None, "", "1") else f" {about['unit']}"


def bounds(about: About) -> str:
    """The allowed values: a range, choices, or nothing."""
    low, high = about.get("minimum"), about.get("maximum")
    if about.get("choices"):
        return ", ".join(about["choices"])
    if low is not None and high is not None:
        return f"{low} to {high}"
    if low is not None:
        return f"at least {low}"
    return f"at most {high}" if high is not None else ""


def example(about: About) -> str:
    """An example value for a flag."""
    for value in (about.get("example"), about.get("default"), (about.get("choices") or [None])[0]):
        if isinstance(value, bool):
            return str(value).lower()
        if value not in (None, []):
            return ",".join(map(str, value)) if isinstance(value, list) else str(value)
    words = {"path": "FOLDER", "string": "TEXT", "memory": "NAME", "list": "A,B"}
    return words.get(about["type"]) or str(about.get("minimum", 1))
