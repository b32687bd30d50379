"""What checks say in JUnit's report, on pages and terminals: what failed, and what only shows where a drive ended."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_OF_THE_WAY = ("time-to-goal", "to-goal", "gates")
"""What a drive that ends early leaves undone."""
_ENDING = ("wall-margin", "max-speed", "silence")
"""What ends it early."""
_WORDS = {"min": ("at least", "more than"), "max": ("at most", "less than")}
"""For a limit that may be reached, and for one that may not."""

Check = Mapping[str, Any]


def only_follows(check: Check, checks: Sequence[Check]) -> bool:
    """Whether a check of a test is not met only as another one ended the drive."""
    ended = any(not other["ok"] and other["name"] in _ENDING for other in checks)
    return ended and not check["ok"] and check["name"] in _OF_THE_WAY


def is_exclusive(check: Check) -> bool:
    """Whether a value at a limit fails, as a wall that is touched: the evaluator says so, or failed such a value."""
    limit = check.get("limit") or {}
    return bool(check.get("exclusive")) or (not check["ok"] and check["value"] in limit.values())


def bound(side: str, number: float, unit: str = "", exclusive: bool = False) -> str:
    """``at least 1 m`` or ``more than 1 m`` for the side ``min``, ``at most 1 m`` or ``less than 1 m`` for ``max``."""
    return f"{_WORDS[side][exclusive]} {number:g} {unit}".rstrip()


def limits(check: Check) -> Iterator[str]:
    """Each limit of a check: ``at least 0.03 m`` and ``at most 1 m``."""
    exclusive = is_exclusive(check)
    for side in ("min", "max"):
        if side in (check.get("limit") or {}):
            yield bound(side, check["limit"][side], check.get("unit") or "", exclusive)


def line(check: Check, checks: Sequence[Check]) -> str:
    """A check of a test in a line."""
    value = "none" if check["value"] is None else f"{check['value']:g} {check.get('unit') or ''}".strip()
    if only_follows(check, checks):
        return f"--   {check['name']}: {value}, when the drive ended"
    limit = ", ".join(limits(check))
    return f"{'ok  ' if check['ok'] else 'FAIL'} {check['name']}: {value}{f' ({limit})' if limit else ''}"
