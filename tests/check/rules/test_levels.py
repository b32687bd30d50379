"""Kinds and clocks that a level cannot have."""

from pathlib import Path

import pytest

from dodo_dsl.check.spec_rules import check_levels
from tests.check.contexts import found


@pytest.mark.parametrize(
    ("level", "kind", "clock", "rules"),
    [
        ("sil", "closed-loop", "lockstep", []),
        ("dil", "open-loop", "lockstep", []),
        ("dil", "closed-loop", "realtime", ["level-kind"]),
        ("hil", "closed-loop", "realtime", []),
        ("hil", "closed-loop", "lockstep", ["clock-level"]),
    ],
)
def test_levels(level: str, kind: str, clock: str, rules: list[str], tmp_path: Path) -> None:
    example = f"level: {level}\nkind: {kind}\nclock: {clock}\n"
    assert [rule for rule, _ in found(check_levels, example, tmp_path)] == rules
