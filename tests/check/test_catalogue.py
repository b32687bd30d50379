"""The rule catalogue: its examples are true; that it has each rule and no other is in test_rows.py."""

from pathlib import Path

import pytest

from dodo_dsl.check import catalogue
from tests.check import examples

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "rules.md"
RULES = sorted(catalogue.pages())
EXAMPLES = [pytest.param(r, marks=[pytest.mark.slow] if r == "pipeline-limit" else []) for r in RULES]
"""All rules, of which one has an example with hundreds of instances."""


@pytest.mark.parametrize("rule", EXAMPLES)
def test_the_bad_example_gives_its_rule(rule: str, tmp_path: Path) -> None:
    page = catalogue.pages()[rule]
    examples.write(page.bad, tmp_path, page.encoding)
    assert rule in {problem.rule for problem in examples.problems(tmp_path)}


def test_the_page_is_up_to_date(update_goldens: bool) -> None:
    if update_goldens:
        catalogue.write(PAGE)
    assert PAGE.read_text() == catalogue.markdown(), "scripts/make-rules brings it up to date"
