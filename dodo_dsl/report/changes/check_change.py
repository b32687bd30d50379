"""How a check's value changed, and whether that is for the better: by the side of its limit and the margin to it."""

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Literal

from dodo_dsl.margins import with_margin
from dodo_dsl.outcome import differs_each_run
from dodo_dsl.report import check_words

NEGLIGIBLE = 0.01
"""Share of a limit by which a value may change without a word, where only its last decimal shows that."""

Direction = Literal["worse", "better", "different", "unchanged"]
"""``different`` is a change of a value that has no limit, or whose limits say nothing of the direction."""


@dataclass(frozen=True)
class CheckChange:
    """A check of a test in both reports; values in its unit, None where nothing was measured."""

    index: int
    """Of the check in the newer report's test."""
    name: str
    unit: str
    before: float | None
    after: float | None
    direction: Direction
    limits: tuple[str, ...]
    """In words, as they are now."""
    old_limits: tuple[str, ...]
    old_unit: str
    is_crossing: bool
    """Whether it is on the other side of its limit now."""

    @property
    def difference(self) -> float | None:
        """Of the values, where they have one unit."""
        is_comparable = self.before is not None and self.after is not None and self.unit == self.old_unit
        return self.after - self.before if is_comparable else None  # type: ignore[operator]


def check_change(before: Mapping[str, Any], after: Mapping[str, Any], index: int) -> CheckChange:
    """The change of a check between two ``results.json``."""
    return CheckChange(
        index,
        after["name"],
        after.get("unit") or "",
        before["value"],
        after["value"],
        _direction(before, after),
        tuple(check_words.limits(after)),
        tuple(check_words.limits(before)),
        before.get("unit") or "",
        bool(before["ok"]) != bool(after["ok"]),
    )


def with_margins(check: Mapping[str, Any]) -> Mapping[str, Any]:
    """The check with ``margin`` and ``margin_share``, computed where an older ``results.json`` has none."""
    return check if "margin" in check and "margin_share" in check else with_margin({"limit": {}, **check})


def _direction(before: Mapping[str, Any], after: Mapping[str, Any]) -> Direction:
    if bool(before["ok"]) != bool(after["ok"]):
        return "better" if after["ok"] else "worse"
    if differs_each_run(after["name"]):
        return "unchanged"  # it differs from run to run
    is_same_unit = (before.get("unit") or "") == (after.get("unit") or "")
    is_same_limit = (before.get("limit") or {}) == (after.get("limit") or {})
    if is_same_unit and is_same_limit and _is_alike(before["value"], after["value"], after.get("limit") or {}):
        return "unchanged"
    old, new = with_margins(before)["margin"], with_margins(after)["margin"]
    if not is_same_unit or old is None or new is None or _shown(old) == _shown(new):
        return "different"
    return "better" if new > old else "worse"


def _is_alike(before: float | None, after: float | None, limit: Mapping[str, float]) -> bool:
    """Whether values look the same, or differ in the last decimal only and by no more than 1 % of the limit.

    Where there is no limit but 0, by 1 % of the values. Counts differ from 1 on.
    """
    texts = _shown(before), _shown(after)
    if before is None or after is None or texts[0] == texts[1]:
        return texts[0] == texts[1]
    decimals = max(-int(Decimal(text).as_tuple().exponent) for text in texts)
    size = max((abs(bound) for bound in limit.values()), default=0.0) or max(abs(before), abs(after))
    change = abs(after - before)
    return decimals > 0 and change < 10 ** (1 - decimals) and change <= NEGLIGIBLE * size


def _shown(value: float | None) -> str:
    """As pages and texts show it: what no one sees is no change."""
    return "none" if value is None else f"{value:.4g}"
