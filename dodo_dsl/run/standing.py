"""How far a running test is."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from dodo_dsl.run.run_state import RunState


@dataclass(frozen=True)
class Standing:
    """The ``seconds`` of its own time that a test has reached, and the check nearest to its limit, in words.

    In real time its time goes on by itself, and this is that of its begin, 0. Checks are known when their evaluator has
    judged, so that ``nearest`` is empty where there is only one.
    """

    seconds: float
    is_lockstep: bool
    nearest: str = ""


def standing(state: RunState) -> Standing:
    """Of what is known now."""
    judged = (check for verdicts in state.facts.verdicts.values() for verdict in verdicts for check in verdict.checks)
    seconds = state.time.seconds if state.time else 0.0
    return Standing(seconds, state.plan.lockstep is not None, _nearest(judged))


def _nearest(checks: Iterable[Mapping[str, Any]]) -> str:
    known = [check for check in checks if check.get("margin_share") is not None]
    if not known:
        return ""
    check = min(known, key=lambda each: float(each["margin_share"]))
    unit = check.get("unit") or ""
    return f"{check['name']} {check['value']:.4g} {unit}".rstrip() + f", margin {check['margin']:.4g} {unit}".rstrip()
