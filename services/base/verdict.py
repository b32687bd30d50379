"""An evaluator's verdict, and the one line that reports it."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any, Literal


@dataclass(frozen=True)
class Check:
    """A measure with its limit, ``min`` and ``max``; no finite value is null.

    A value at a limit passes, unless the limits are ``exclusive``, as of a distance that has to be more than 0.
    ``parameters`` of the manifest set the limit, where they are not ``max-NAME``, ``min-NAME`` or ``NAME``: the report
    shows their lines of the spec.
    """

    name: str
    value: float | None
    limit: Mapping[str, float] = field(default_factory=dict)
    unit: str = ""
    ok: bool = True
    exclusive: bool = False
    parameters: tuple[str, ...] = field(default=(), compare=False)

    def as_json(self) -> dict[str, Any]:
        """The check in the verdict line; numbers may come from numpy."""
        return {
            "name": self.name,
            "value": _number(self.value),
            "limit": {key: _number(bound) for key, bound in self.limit.items() if math.isfinite(bound)},
            "unit": self.unit,
            "ok": bool(self.ok),
            **({"exclusive": True} if self.exclusive else {}),
        }


@dataclass(frozen=True)
class Verdict:
    """Passed or failed, in one sentence, with checks; ``silent`` when nothing of the application came.

    ``evidence`` is the data of the decision, by lower-case words with hyphens: ``time`` in s of the test, and where and
    what the evaluator saw then. At most 20 numbers or strings of 200 characters; no finite number is null.
    """

    outcome: Literal["passed", "failed"]
    reason: str
    checks: tuple[Check, ...] = ()
    silent: bool = False
    evidence: Mapping[str, float | str | None] = field(default_factory=dict)

    def line(self, cid: int) -> str:
        """The verdict line, without its line break; ASCII, whatever the locale.

        A silent application may have been on another bus, so the reason names the test's.
        """
        checks = [check.as_json() for check in self.checks]
        reason = f"{self.reason}; the test is on CID {cid}" if self.silent else self.reason
        message: dict[str, Any] = {"dodo": "verdict", "outcome": self.outcome, "reason": reason, "checks": checks}
        if self.evidence:
            numbers = {key: v if isinstance(v, str) else _number(v) for key, v in self.evidence.items()}
            message["evidence"] = numbers
        return json.dumps(message, allow_nan=False)


def undeclared_checks(verdict: Verdict, declared: Mapping[str, str] | None) -> str:
    """What is wrong where the manifest's ``checks`` lack some of a verdict's; empty where they lack none, or are none.

    The verdict counts all the same: only goals of tests cannot name such a check.
    """
    patterns = tuple(declared or ())
    names = [c.name for c in verdict.checks if not any(fnmatchcase(c.name, pattern) for pattern in patterns)]
    if not patterns or not names:
        return ""
    what = f"check '{names[0]}' is" if len(names) == 1 else f"checks {', '.join(map(repr, names))} are"
    it = "it" if len(names) == 1 else "them"
    return f"{what} not among the 'checks' of its service.yml ({', '.join(patterns)}), so no goal can name {it}"


def _number(value: float | None) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return value if isinstance(value, int) else float(value)
