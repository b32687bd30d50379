"""``docs/reference/hostile-tests.md`` says what the tests show."""

import runpy

import pytest

from tests.run.desk import ROOT


@pytest.mark.slow
def test_its_table_is_that_of_the_tests() -> None:
    made = runpy.run_path(str(ROOT / "scripts" / "make-security"), run_name="security")
    assert (ROOT / "docs" / "reference" / "hostile-tests.md").read_text() == made["page"](), "run scripts/make-security"
