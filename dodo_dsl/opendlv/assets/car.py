"""What a car is to the single-track model: its parameters, from a file if it is not the Kiwi car."""

import difflib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.numbers import number


class CarError(ValueError):
    """A file that does not describe a car; one sentence with file and line."""


@dataclass(frozen=True)
class Car:
    """Parameters in SI units; the defaults are the Kiwi car of the public Kiwi simulation."""

    mass: float = 1.113
    """kg"""
    inertia: float = 0.01
    """kg m2, about the vertical axis"""
    front: float = 0.12
    """m, centre of mass to the front axle"""
    rear: float = 0.104
    """m, centre of mass to the rear axle"""
    cornering_front: float = 15.0
    """N/rad, both front wheels"""
    cornering_rear: float = 15.0
    """N/rad, both rear wheels"""
    resistance: float = 4.0
    """N s/m"""
    gain_forward: float = 26.0
    """N per unit of pedal, forward"""
    gain_reverse: float = 5.0
    """N per unit of pedal, in reverse"""
    steering_gain: float = 0.6 / 0.290888
    """angle of the wheel per requested angle"""
    steering_limit: float = 0.6
    """rad, at the wheel, to either side"""
    pedal_reverse: float = -0.9
    """lowest pedal that is taken"""
    pedal_forward: float = 0.14
    """highest pedal that is taken"""
    slip_speed: float = 0.1
    """m/s; the tyres carry sideways only above this speed"""


MOST_BYTES = 1 << 20
KIWI = Car()
KEYS = {field.name.replace("_", "-"): field.name for field in fields(Car)}

_POSITIVE = ("mass", "inertia", "front", "rear", "resistance", "steering-limit", "slip-speed")
_NEGATIVE = ("pedal-reverse",)
_ANY = ("steering-gain",)


def read_car(path: Path) -> Car:
    """The car of a YAML or JSON file, the Kiwi's for parameters that it omits; raises CarError."""
    text = ""
    try:
        text = regular_file.text(path, MOST_BYTES)
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except OSError as error:
        raise CarError(f"{path} cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        _without_space(path, text)
        mark = getattr(error, "problem_mark", None)
        place = f"{path}:{mark.line + 1}" if mark else str(path)
        raise CarError(f"{place}: neither YAML nor JSON: {getattr(error, 'problem', None) or error}") from None
    if not isinstance(node, yaml.MappingNode):
        _without_space(path, text)
        raise CarError(f"{path}: expected the parameters of a car, such as 'mass: 1.113'")
    given: dict[str, float] = {}
    for place, name, value in _entries(path, node):
        if KEYS[name] in given:
            raise CarError(f"{place}: {name} appears twice")
        given[KEYS[name]] = value
    return replace(KIWI, **given)


def _without_space(path: Path, text: str) -> None:
    """Raises CarError for a line ``mass:1``, with which YAML has no parameters."""
    for at, line in enumerate(text.splitlines(), 1):
        match = re.match(r"(?P<name>[a-z-]+):(?P<value>[^\s:]+)", line)
        if match and match["name"] in KEYS:
            what = f"a space is missing after the colon, write '{match['name']}: {match['value']}'"
            raise CarError(f"{path}:{at}:{match.end('name') + 1}: {what}")


def _entries(path: Path, node: yaml.MappingNode) -> Iterator[tuple[str, str, float]]:
    for key, value in node.value:
        place, name = f"{path}:{key.start_mark.line + 1}", str(key.value)
        if name not in KEYS:
            close = difflib.get_close_matches(name, KEYS, 1)
            raise CarError(f"{place}: unknown parameter '{name}'" + (f", did you mean '{close[0]}'?" if close else ""))
        yield place, name, _checked(f"{place}: {name}", name, _number(value))


def _number(node: Any) -> float:
    if not isinstance(node, yaml.ScalarNode) or node.style is not None:
        return math.nan
    try:
        return number(node.value)
    except ValueError:
        return math.nan


def _checked(what: str, name: str, value: float) -> float:
    if not math.isfinite(value):
        raise CarError(f"{what} is not a finite number")
    if name in _ANY:
        return value
    if name in _NEGATIVE:
        if value > 0:
            raise CarError(f"{what} is {value:g}, expected 0 or less")
    elif value < 0 or (value == 0 and name in _POSITIVE):
        raise CarError(f"{what} is {value:g}, expected {'more than 0' if name in _POSITIVE else '0 or more'}")
    return value
