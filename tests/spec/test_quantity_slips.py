"""What values mean that are no quantities as they are written."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.spec.quantity import UNITS, QuantityError, convert


@pytest.mark.parametrize(("text", "unit", "meant"), [("10 hz", "Hz", "Hz"), ("1gb", "B", "GB"), ("1 kb", "B", "kB")])
def test_a_unit_in_other_letters_is_named(text: str, unit: str, meant: str) -> None:
    with pytest.raises(QuantityError) as problem:
        convert(text, unit)
    assert problem.value.hint == f"did you mean '{meant}'?"


NUMBERS = st.sampled_from(("1", "-1", "1,5", "1.5", ".5", "1e3", "1.000,5", "+2", ",", "", "\u22121", "0x1"))
SIGNS = st.sampled_from(("", " ", "  ", ",", ";", "# x", " # x"))


@given(NUMBERS, SIGNS, st.sampled_from(("", *UNITS, "sec", "\u00b0", "hz", "parsecs")), SIGNS, st.sampled_from(UNITS))
def test_what_a_hint_says_to_write_is_a_quantity(
    number: str, between: str, written: str, behind: str, unit: str
) -> None:
    for value in (f"{number}{between}{written}{behind}", True):
        try:
            convert(value, unit)
        except QuantityError as problem:
            for meant in re.findall(r"^write (?:for example )?'([^']*)'", problem.hint):
                convert(meant, unit)
