"""Each rule is caught by a paired case: without its diagnostics the output of the case is another one.

``pytest -s tests/check/test_each_rule.py`` prints how many cases catch each rule.
"""

import re
import sys
from collections.abc import Iterable

import pytest

from dodo_dsl import diagnostics
from dodo_dsl.check import catalogue
from dodo_dsl.cli.main import COMMANDS
from dodo_dsl.diagnostics import Diagnostic
from tests.check.test_bad_specs import CASES, expected, said, slow_where_large

RULES = sorted(catalogue.pages())
_RULE = re.compile(r"(?:error|warning)\[([a-z-]+)\]: ")
_ordered = diagnostics.ordered


def without(rule: str, patch: pytest.MonkeyPatch) -> None:
    """Drops a rule's diagnostics wherever diagnostics are collected."""

    def kept(found: Iterable[Diagnostic]) -> list[Diagnostic]:
        return _ordered(d for d in found if d.rule != rule)

    COMMANDS["compile"].load()
    collectors = [m for m in sys.modules.values() if getattr(m, "ordered", None) is _ordered]
    assert {"dodo_dsl.compiler", "dodo_dsl.cli.compile"} <= {m.__name__ for m in collectors}
    for module in collectors:
        patch.setattr(module, "ordered", kept)


@pytest.mark.thorough
@pytest.mark.parametrize("rule", slow_where_large(RULES))
def test_a_case_fails_without_the_rule(rule: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the cases that show the rule are run again, as the others do not depend on it."""
    showing = [case for case in CASES if rule in _RULE.findall(expected(case))]
    without(rule, monkeypatch)
    caught = [case for case in showing if said(case, monkeypatch)[1] != expected(case)]
    print(f"\n{rule}: {len(caught)} ({', '.join(caught[:3])}{', ...' if len(caught) > 3 else ''})", end="")
    assert caught
    assert caught == showing
