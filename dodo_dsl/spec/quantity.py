"""Quantities with units, converted decimally: ``9.5 cm`` to metres is 0.095, not 0.09500000000000001."""

import re
from decimal import Decimal, InvalidOperation, localcontext

from dodo_dsl.diagnostics import did_you_mean

SHARE = "1"
"""The unit of shares, which need none: 0.5 is 50 %."""

_PI = Decimal("3.14159265358979323846264338328")
_FACTORS: dict[str, dict[str, Decimal]] = {
    "length": {"m": Decimal(1), "mm": Decimal("0.001"), "cm": Decimal("0.01"), "km": Decimal(1000)},
    "time": {
        "s": Decimal(1),
        "us": Decimal("0.000001"),
        "ms": Decimal("0.001"),
        "min": Decimal(60),
        "h": Decimal(3600),
    },
    "frequency": {"Hz": Decimal(1), "kHz": Decimal(1000)},
    "angle": {"rad": Decimal(1), "deg": _PI / 180},
    "speed": {"m/s": Decimal(1), "cm/s": Decimal("0.01"), "km/h": Decimal(1) / Decimal("3.6")},
    "yaw rate": {"rad/s": Decimal(1), "deg/s": _PI / 180},
    "acceleration": {"m/s2": Decimal(1), "cm/s2": Decimal("0.01")},
    "angular acceleration": {"rad/s2": Decimal(1), "deg/s2": _PI / 180},
    "share": {SHARE: Decimal(1), "%": Decimal("0.01")},
    "pixel count": {"px": Decimal(1)},
    "size": {"B": Decimal(1), "kB": Decimal(10**3), "MB": Decimal(10**6), "GB": Decimal(10**9)},
    "step count": {"steps": Decimal(1)},
    "step density": {"steps/m": Decimal(1), "steps/mm": Decimal(1000)},
    "angular step density": {"steps/rad": Decimal(1), "steps/deg": 180 / _PI},
    "mass": {"kg": Decimal(1), "g": Decimal("0.001")},
}
_DIMENSION = {unit: dimension for dimension, units in _FACTORS.items() for unit in units}
_NUMBER = r"[-+]?(?:\d{1,40}(?:\.\d{0,40})?|\.\d{1,40})(?:[eE][-+]?\d{1,3})?"
_QUANTITY = re.compile(rf"\s*(?P<number>{_NUMBER})\s*(?P<unit>[A-Za-z%/°µ][A-Za-z0-9/%°µ^²]*)?\s*", re.ASCII)
_DIGITS = 15
_MAX_TEXT = 100

UNITS = tuple(_DIMENSION)


_SHARES = "write for example 0.5 or 50 %"


class QuantityError(ValueError):
    """A value is not a quantity in the expected unit; ``hint`` suggests one."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


def _a(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"


def _example(number: str, unit: str) -> str:
    return _SHARES if unit == SHARE else f"write for example '{number} {unit}'"


def convert(value: object, unit: str) -> Decimal:
    """A written value such as ``"9.5 cm"`` as a number of ``unit``.

    Raises QuantityError for a bare number, an unknown unit and a unit of another dimension.
    """
    expected = "a share" if unit == SHARE else f"a quantity in {unit}"
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise QuantityError(f"expected {expected}", _example("1", unit))
    text, siblings = str(value), _FACTORS[_DIMENSION[unit]]
    match = _QUANTITY.fullmatch(text) if len(text) <= _MAX_TEXT else None
    written = (match["unit"] or (SHARE if unit == SHARE else "")) if match else None
    if match is None or (unit == SHARE and written not in siblings):
        shown = text if len(text) <= _MAX_TEXT else f"{text[:20]}..."
        point = with_point(text) if (written_unit(text.replace(",", ".", 1)) or SHARE) in siblings else ""
        raise QuantityError(f"'{shown}' is not {expected}", point or _example("1", unit))
    if not written:
        raise QuantityError(f"'{text}' has no unit, expected {_a(_DIMENSION[unit])} in {unit}", _example(text, unit))
    if written not in _DIMENSION:
        raise QuantityError(f"unknown unit '{written}'", did_you_mean(written, siblings))
    if written not in siblings:
        message = f"'{text}' is {_a(_DIMENSION[written])}, expected {_a(_DIMENSION[unit])} in {unit}"
        raise QuantityError(message, _example(match["number"], unit))
    return _converted(match["number"], written, unit)


def in_base_unit(text: str) -> Decimal:
    """A bare number, or a quantity in the base unit of its dimension: ``3 deg`` in rad. Raises QuantityError.

    For what carries no unit that is known here, such as the field of any message; a share is not such a quantity.
    """
    unit = written_unit(text)
    dimension = _DIMENSION[unit or SHARE]
    if unit is None or (unit and dimension == "share"):
        hint = with_point(text) or "write for example 0.05 or '0.05 rad'"
        raise QuantityError(f"'{text[:_MAX_TEXT]}' is not a number or a quantity", hint)
    return convert(text, next(iter(_FACTORS[dimension])))


def with_point(text: str) -> str:
    """A hint about a decimal comma; empty if there is none."""
    point = text.replace(",", ".", 1)
    return f"write '{point}', with a point" if point != text and _QUANTITY.fullmatch(point) else ""


def written_unit(text: str) -> str | None:
    """The unit that a quantity is written in, empty for a bare number; None for what is neither."""
    match = _QUANTITY.fullmatch(text) if len(text) <= _MAX_TEXT else None
    unit = (match["unit"] or "") if match else None
    return unit if not unit or unit in _DIMENSION else None


_MOST_DIGITS = 301
"""Before the point, or zeros after it: services calculate with numbers of 64 bits."""


def _converted(number: str, written: str, unit: str) -> Decimal:
    units = _FACTORS[_DIMENSION[unit]]
    with localcontext() as context:
        context.prec = 60
        try:
            exact = Decimal(number)
        except InvalidOperation as error:
            raise QuantityError(f"'{number}' is not a number") from error
        result = exact
        if written != unit:
            result = exact * units[written] / units[unit]
            context.prec = _DIGITS
            result = +result
    if result and abs(result.adjusted()) >= _MOST_DIGITS:
        size = "large" if result.adjusted() > 0 else "small"
        raise QuantityError(f"'{number}' is too {size} a number", "write one between 1e-300 and 1e300")
    return result


def decimal_text(number: Decimal) -> str:
    """A number as a flag carries it: no exponent, no trailing zeros, no negative zero."""
    text = f"{number:f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text
