"""The words for changes, which the terminal, Markdown and the page have in common."""

from dodo_dsl.report.changes.check_change import CheckChange
from dodo_dsl.report.changes.comparison import TestChange


def value(number: float | None, unit: str) -> str:
    """``0.052 m``, or ``none``"""
    return "none" if number is None else f"{number:.4g} {unit}".rstrip()


def difference(check: CheckChange) -> str:
    """``-0.07 m``; empty where there is none to tell."""
    return "" if not check.difference else f"{check.difference:+.3g} {check.unit}".rstrip()


def change(check: CheckChange) -> str:
    """``0.12 m -> 0.05 m (-0.07 m; limit: at least 0.03 m)``"""
    limit, old = ", ".join(check.limits), ", ".join(check.old_limits)
    was = f", was {old or 'none'}" if limit != old else ""
    notes = [difference(check), f"limit: {limit or 'none'}{was}" if limit or was else ""]
    told = "; ".join(filter(None, notes))
    return f"{value(check.before, check.old_unit)} -> {value(check.after, check.unit)}{f' ({told})' if told else ''}"


def outcomes(test: TestChange) -> str:
    """``passed -> failed``, or the only one there is."""
    found = [outcome.outcome for outcome in (test.before, test.after) if outcome is not None]
    return " -> ".join(dict.fromkeys(found))
