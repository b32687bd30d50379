"""What became of a test: the value that running ends with and reporting begins with."""

from dataclasses import dataclass
from typing import Any, Literal

Result = Literal["passed", "failed", "error"]


@dataclass(frozen=True)
class Wait:
    """What some services of a test ran on processors together, and how long one of them waited for one; times in s.

    ``longest`` is the service that waited the longest; ``displaced_s`` is the part of its wait in which the machine was
    full and others than the application took most of it.
    """

    ran_s: float
    waited_s: float
    displaced_s: float
    longest: str


@dataclass(frozen=True)
class MachineLoad:
    """How busy the machine was during a test in real time; times in s, None for what was not measured."""

    duration_s: float
    cores: int | None = None
    application: Wait | None = None
    services: Wait | None = None
    """DoDo's own, of the same test."""
    others_share: float | None = None
    """Share of the cores that others than this test took."""
    crowded_s: float | None = None
    """For how long the machine was full, and others than the application took most of it."""
    late_pictures_share: float = 0.0
    """Share of the pictures that came later than half a period."""
    late_updates_share: float = 0.0
    """Share of the updates of any other of DoDo's services, the one with the largest."""
    lateness_s: float = 0.0
    """How late an update of DoDo's services ended, at worst."""
    undecided: bool = False
    """Whether a test that failed is in error, as the machine was too busy."""


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
    machine: MachineLoad | None = None
