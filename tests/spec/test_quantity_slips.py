"""What values mean that are no quantities as they are written."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.spec.quantity import UNITS, QuantityError, convert

MENDED = [
    ("10 hz", "Hz", "10 Hz"),
    ("1gb", "B", "1GB"),
    ("1 kb", "B", "1 kB"),
]


@pytest.mark.parametrize(("text", "unit", "mended"), MENDED)
def test_a_value_with_exactly_one_fix(text: str, unit: str, mended: str) -> None:
    with pytest.raises(QuantityError) as problem:
        convert(text, unit)
    assert problem.value.fix is not None
    assert problem.value.hint
    assert problem.value.fix.mended(text) == mended
    convert(mended, unit)


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
