"""Numbers on a command line, as types of argparse."""

import argparse
import math

from dodo_dsl.opendlv import numbers

_MOST_SECONDS = 864_000.0


def finite(text: str) -> float:
    """A finite number."""
    try:
        value = numbers.number(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number")
    return value


def patience(text: str) -> float:
    """Seconds, 0 or more."""
    if (value := finite(text)) < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a time in seconds, expected 0 or more")
    return value


def seed(text: str) -> int:
    """A seed of 32 bits."""
    value = numbers.whole(text) if numbers.is_whole(text) else -1
    if not 0 <= value < 1 << 32:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 0 to 4294967295")
    return value


def seconds(text: str) -> float:
    """A duration, at most ten days."""
    try:
        value = numbers.number(text.removesuffix("s"))
    except ValueError:
        value = 0.0
    if not 0.0 < value <= _MOST_SECONDS:
        raise argparse.ArgumentTypeError(f"'{text}' is not a time in seconds above 0 and at most {_MOST_SECONDS:g}")
    return value


def minutes(text: str) -> float:
    """A duration in minutes, at most ten days."""
    value = finite(text)
    if not 0.0 < value <= _MOST_SECONDS / 60:
        raise argparse.ArgumentTypeError(
            f"'{text}' is not a time in minutes above 0 and at most {_MOST_SECONDS / 60:g}"
        )
    return value


def shard(text: str) -> tuple[int, int]:
    """``I/N``: the part of several that is meant, from 1 on, and how many there are."""
    index, _, total = text.partition("/")
    found = [numbers.whole(part) if numbers.is_whole(part) else 0 for part in (index, total)]
    if not 1 <= found[0] <= found[1]:
        raise argparse.ArgumentTypeError(f"'{text}' is not a part of several, expected 1/4 to 4/4 for four")
    return found[0], found[1]


def positive(text: str) -> int:
    """A whole number of at least 1."""
    value = numbers.whole(text) if numbers.is_whole(text) else 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of at least 1")
    return value
