"""Rigs of hil tests, and only of those."""

from pathlib import Path

import pytest

from dodo_dsl.check.spec_rules import check_rigs
from tests.check.contexts import context, found

RIGS = "# dodo.yml\nrigs: {kiwi: {kind: dynamic, cid: 121}}\n"


@pytest.mark.parametrize(
    ("example", "rules"),
    [
        ("level: hil\n", ["rig-level"]),
        ("level: hil\nrig: emulated\n", []),
        ("level: hil\nrig: emulated\nisolation: network\n", []),
        ("level: hil\nrig: kiwi\n", []),
        ("level: hil\nrig: kiwi\nisolation: host\n", []),
        ("level: hil\nrig: kiwi\nisolation: network\n", ["rig-isolation"]),
        ("level: sil\nrig: kiwi\n", ["rig-level"]),
        ("level: sil\nrig: none\n", ["rig-level", "unknown-rig"]),
    ],
)
def test_rigs(example: str, rules: list[str], tmp_path: Path) -> None:
    assert [rule for rule, _ in found(check_rigs, example + RIGS, tmp_path)] == rules


def test_a_misspelt_rig(tmp_path: Path) -> None:
    (problem,) = check_rigs(context(f"level: hil\nrig: kiwy\n{RIGS}", tmp_path))
    assert (problem.message, problem.hint) == ("unknown rig 'kiwy'", "did you mean 'kiwi'?")
