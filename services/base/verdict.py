"""What an evaluator found, and the one line that says so."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True)
class Check:
    """A measure with its limit (``min`` and ``max``, both inclusive); no finite value is null."""

    name: str
    value: float | None
    limit: Mapping[str, float] = field(default_factory=dict)
    unit: str = ""
    ok: bool = True


@dataclass(frozen=True)
class Verdict:
    """Passed or failed, in one sentence, with what was measured."""

    outcome: Literal["passed", "failed"]
    reason: str
    checks: tuple[Check, ...] = ()

    def line(self) -> str:
        """The verdict line of design section 6, without its line break."""
        checks = [
            {
                "name": check.name,
                "value": check.value if check.value is not None and math.isfinite(check.value) else None,
                "limit": {k: v for k, v in check.limit.items() if math.isfinite(v)},
                "unit": check.unit,
                "ok": check.ok,
            }
            for check in self.checks
        ]
        message = {"dodo": "verdict", "outcome": self.outcome, "reason": self.reason, "checks": checks}
        return json.dumps(message, ensure_ascii=False, allow_nan=False)
