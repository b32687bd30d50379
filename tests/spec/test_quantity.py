"""Quantities convert decimally, and say what is wrong with the others."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.spec.quantity import UNITS, QuantityError, convert, decimal_text

CASES = [
    ("10 Hz", "Hz", "10"),
    ("9.5 cm", "m", "0.095"),
    ("1e300 m", "m", "1" + "0" * 300),
    ("0e999 m", "m", "0"),
    ("9.5cm", "m", "0.095"),
    ("48.8 deg", "deg", "48.8"),
    ("180 deg", "rad", "3.14159265358979"),
    ("3.14159265358979323846 rad", "deg", "180"),
    ("36 km/h", "m/s", "10"),
    ("1.5 min", "s", "90"),
    ("-1e-3 m", "m", "-0.001"),
    ("100 ms", "s", "0.1"),
    ("50 %", "1", "0.5"),
    (0.25, "1", "0.25"),
    ("0.1 m", "mm", "100"),
]


@pytest.mark.parametrize(("written", "unit", "expected"), CASES)
def test_converts(written: object, unit: str, expected: str) -> None:
    assert decimal_text(convert(written, unit)) == expected


REFUSED = [
    (10, "Hz", "'10' has no unit, expected a frequency in Hz"),
    ("10", "Hz", "'10' has no unit, expected a frequency in Hz"),
    ("10 cm", "Hz", "'10 cm' is a length, expected a frequency in Hz"),
    ("10 hz", "Hz", "unknown unit 'hz'"),
    ("ten Hz", "Hz", "'ten Hz' is not a quantity in Hz"),
    ("1 2 m", "m", "'1 2 m' is not a quantity in m"),
    ("", "m", "'' is not a quantity in m"),
    (True, "m", "expected a quantity in m"),
    ([1], "m", "expected a quantity in m"),
    ("1e999 m", "m", "'1e999' is too large a number"),
    ("-1e301 m", "mm", "'-1e301' is too large a number"),
    ("1e-999 m", "m", "'1e-999' is too small a number"),
    ("nan m", "m", "'nan m' is not a quantity in m"),
    ("1" * 41 + " m", "m", f"'{'1' * 41} m' is not a quantity in m"),
]


@pytest.mark.parametrize(("written", "unit", "message"), REFUSED)
def test_refuses(written: object, unit: str, message: str) -> None:
    with pytest.raises(QuantityError) as error:
        convert(written, unit)
    assert str(error.value) == message


@pytest.mark.parametrize(("text", "unit", "meant"), [("10 hz", "Hz", "Hz"), ("1gb", "B", "GB"), ("1 kb", "B", "kB")])
def test_a_unit_in_other_letters_is_named(text: str, unit: str, meant: str) -> None:
    with pytest.raises(QuantityError) as problem:
        convert(text, unit)
    assert problem.value.hint == f"did you mean '{meant}'?"


@given(st.text(max_size=30), st.sampled_from(UNITS))
@pytest.mark.thorough
def test_any_text_converts_or_is_refused(text: str, unit: str) -> None:
    try:
        assert convert(text, unit).is_finite()
    except QuantityError as error:
        assert str(error)
