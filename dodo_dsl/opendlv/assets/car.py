"""What a car is to the single-track model: its parameters, from a file if it is not the Kiwi car."""

import difflib
import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.numbers import number


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

_ABOVE = dict.fromkeys(
    ("mass", "inertia", "front", "rear", "resistance", "steering-limit", "slip-speed"), "more than 0"
)
_EXPECTED = {**dict.fromkeys(KEYS, "0 or more"), **_ABOVE, "pedal-reverse": "0 or less", "steering-gain": "a number"}
_IS_WITHIN: dict[str, Callable[[float], bool]] = {
    "more than 0": lambda value: value > 0,
    "0 or more": lambda value: value >= 0,
    "0 or less": lambda value: value <= 0,
    "a number": lambda value: True,
}


def read_car(path: Path) -> Car:
    """The car of a YAML or JSON file, the Kiwi's for parameters that it omits; raises InputError."""
    try:
        node = yaml.compose(regular_file.text(path, MOST_BYTES), Loader=yaml.SafeLoader)
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        what = f"neither YAML nor JSON: {getattr(error, 'problem', None) or error}"
        raise InputError(path, what, line=mark.line + 1 if mark else 0) from None
    if not isinstance(node, yaml.MappingNode):
        hint = "write a space behind each colon"
        line = node.start_mark.line + 1 if node else 1
        raise InputError(path, "expected the parameters of a car, such as 'mass: 1.113'", line=line, hint=hint)
    given: dict[str, float] = {}
    for key, value in node.value:
        name = str(key.value)
        if what := _problem(name, value) or (f"{name} appears twice" if KEYS[name] in given else ""):
            raise InputError(path, what, line=key.start_mark.line + 1, column=key.start_mark.column + 1)
        given[KEYS[name]] = number(value.value)
    return replace(KIWI, **given)


def _problem(name: str, node: Any) -> str:
    if name not in KEYS:
        close = difflib.get_close_matches(name, KEYS, 1)
        return f"unknown parameter '{name}'" + (f", did you mean '{close[0]}'?" if close else "")
    try:
        value = number(node.value) if isinstance(node, yaml.ScalarNode) and node.style is None else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        return f"{name} is not a finite number"
    expected = _EXPECTED[name]
    return "" if _IS_WITHIN[expected](value) else f"{name} is {value:g}, expected {expected}"
