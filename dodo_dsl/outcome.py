"""What became of a test: the value that running ends with and reporting begins with."""

from dataclasses import dataclass
from typing import Any, Literal

Result = Literal["passed", "failed", "error"]


@dataclass(frozen=True)
class Outcome:
    """What became of a test; times in seconds, None where the test did not get so far."""

    name: str
    slug: str
    spec: str
    level: str
    kind: str
    outcome: Result
    reason: str
    cid: int
    seed: int
    clock: str
    backend: str
    setup_s: float | None = None
    execution_s: float | None = None
    sim_s: float | None = None
    services: tuple[dict[str, Any], ...] = ()
    checks: tuple[dict[str, Any], ...] = ()
    last_lines: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    description: str = ""
