"""Numbers on a command line, as types of argparse."""

import argparse
import math

from dodo_dsl.opendlv import numbers


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
