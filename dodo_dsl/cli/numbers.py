"""Numbers on a command line, as types of argparse."""

import argparse
import math
from typing import TypeVar

from dodo_dsl.opendlv import numbers

_MOST_SECONDS = 864_000.0
T = TypeVar("T")


def _checked(text: str, value: T, is_good: bool, expected: str) -> T:
    if not is_good:
        raise argparse.ArgumentTypeError(f"'{text}' is not {expected}")
    return value


def _number(text: str) -> float:
    """NaN if it is none."""
    try:
        return numbers.number(text)
    except ValueError:
        return math.nan


def _whole(text: str) -> int:
    """-1 if it is none."""
    return numbers.whole(text) if numbers.is_whole(text) else -1


def finite(text: str) -> float:
    """A finite number."""
    return _checked(text, _number(text), math.isfinite(_number(text)), "a number")


def patience(text: str) -> float:
    """Seconds, 0 or more."""
    return _checked(text, finite(text), finite(text) >= 0, "a time in seconds, expected 0 or more")


def seed(text: str) -> int:
    """A seed of 32 bits."""
    return _checked(text, _whole(text), 0 <= _whole(text) < 1 << 32, "a whole number from 0 to 4294967295")


def seconds(text: str) -> float:
    """A duration, at most ten days."""
    value, most = _number(text.removesuffix("s")), _MOST_SECONDS
    return _checked(text, value, 0.0 < value <= most, f"a time in seconds above 0 and at most {most:g}")


def shard(text: str) -> tuple[int, int]:
    """``I/N``: the part of several that is meant, from 1 on, and how many there are."""
    index, _, total = text.partition("/")
    found = _whole(index), _whole(total)
    return _checked(text, found, 1 <= found[0] <= found[1], "a part of several, expected 1/4 to 4/4 for four")


def positive(text: str) -> int:
    """A whole number of at least 1."""
    return _checked(text, _whole(text), _whole(text) >= 1, "a whole number of at least 1")
