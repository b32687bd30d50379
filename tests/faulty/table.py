"""The faults of ``faults.yml``, ``faults_of_ranges.yml`` and ``faults_of_ros.yml``: what the tests have to find."""

from dataclasses import dataclass
from pathlib import Path

import yaml

TABLE, RANGES_TABLE, ROS_TABLE = (Path(__file__).with_name(f"faults{of}.yml") for of in ("", "_of_ranges", "_of_ros"))


@dataclass(frozen=True)
class Fault:
    """A faulty application, and the shipped ``test`` that has to fail with ``words``, a regular expression.

    ``kind`` is what the fault spoils, ``does`` a sentence.
    """

    name: str
    kind: str
    does: str
    test: str
    words: str


def _faults(table: Path) -> dict[str, Fault]:
    return {name: Fault(name, **about) for name, about in yaml.safe_load(table.read_text(encoding="utf-8")).items()}


FAULTS = _faults(TABLE)
RANGES = _faults(RANGES_TABLE)
ROS = _faults(ROS_TABLE)
"""Of examples/ranges and examples/ros, which have tests of their own."""
