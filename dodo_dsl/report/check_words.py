"""What checks say in JUnit's report, on pages and terminals: what failed, and what only shows where a drive ended."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_OF_THE_WAY = ("time-to-goal", "to-goal", "gates")
"""What a drive that ends early leaves undone."""
_ENDING = ("wall-margin", "max-speed", "silence")
"""What ends it early."""
_WORDS = {"min": ("min", "more than"), "max": ("max", "less than")}
"""For a limit that may be reached, and for one at which a check failed."""

Check = Mapping[str, Any]


def only_follows(check: Check, checks: Sequence[Check]) -> bool:
    """Whether a check of a test is not met only as another one ended the drive."""
    ended = any(not other["ok"] and other["name"] in _ENDING for other in checks)
    return ended and not check["ok"] and check["name"] in _OF_THE_WAY


def is_exclusive(check: Check, side: str) -> bool:
    """Whether a check failed exactly at its limit, as a wall that is touched: the limit has to be exceeded."""
    return not check["ok"] and check["value"] is not None and check["value"] == check["limit"][side]


def limits(check: Check, unit: str = "") -> Iterator[str]:
    """``min 0.03 m`` and ``max 1 m``."""
    for side, bound in (check.get("limit") or {}).items():
        yield f"{_WORDS[side][is_exclusive(check, side)]} {bound:g} {unit}".rstrip()


def line(check: Check, checks: Sequence[Check]) -> str:
    """A check of a test in a line."""
    value = "none" if check["value"] is None else f"{check['value']:g} {check.get('unit') or ''}".strip()
    if only_follows(check, checks):
        return f"--   {check['name']}: {value}, when the drive ended"
    limit = ", ".join(limits(check))
    return f"{'ok  ' if check['ok'] else 'FAIL'} {check['name']}: {value}{f' ({limit})' if limit else ''}"
