"""What a car is to the single-track model: its parameters, from a file if it is not the Kiwi car."""

import re
from pathlib import Path
from typing import Annotated

import yaml
from msgspec import Meta, Struct

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets.json_file import MAX_NUMBER, converted
from dodo_dsl.opendlv.assets.problem import InputError

MOST_BYTES = 1 << 20
Above0 = Annotated[float, Meta(gt=0, le=MAX_NUMBER)]
Least0 = Annotated[float, Meta(ge=0, le=MAX_NUMBER)]
Most0 = Annotated[float, Meta(ge=-MAX_NUMBER, le=0)]
Any0 = Annotated[float, Meta(ge=-MAX_NUMBER, le=MAX_NUMBER)]


class Car(Struct, frozen=True, rename="kebab", forbid_unknown_fields=True):
    """Parameters in SI units; the defaults are the Kiwi car of the public Kiwi simulation."""

    mass: Above0 = 1.113
    """kg"""
    inertia: Above0 = 0.01
    """kg m2, about the vertical axis"""
    front: Above0 = 0.12
    """m, centre of mass to the front axle"""
    rear: Above0 = 0.104
    """m, centre of mass to the rear axle"""
    cornering_front: Least0 = 15.0
    """N/rad, both front wheels"""
    cornering_rear: Least0 = 15.0
    """N/rad, both rear wheels"""
    resistance: Above0 = 4.0
    """N s/m"""
    gain_forward: Least0 = 26.0
    """N per unit of pedal, forward"""
    gain_reverse: Least0 = 5.0
    """N per unit of pedal, in reverse"""
    steering_gain: Any0 = 0.6 / 0.290888
    """angle of the wheel per requested angle"""
    steering_limit: Above0 = 0.6
    """rad, at the wheel, to either side"""
    pedal_reverse: Most0 = -0.9
    """lowest pedal that is taken"""
    pedal_forward: Least0 = 0.14
    """highest pedal that is taken"""
    slip_speed: Above0 = 0.1
    """m/s; the tyres carry sideways only above this speed"""


KIWI = Car()


def read_car(path: Path) -> Car:
    """The car of a YAML or JSON file, the Kiwi's for parameters that it omits; raises InputError."""
    try:
        text = regular_file.text(path, MOST_BYTES)
        values = yaml.load(text, Loader=yaml.BaseLoader)  # noqa: S506 - texts alone: YAML 1.1 reads 1_0 as a number
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        what = f"neither YAML nor JSON: {getattr(error, 'problem', None) or error}"
        raise InputError(path, what, line=mark.line + 1 if mark else 0) from None
    try:
        return converted(path, values, Car, strict=False)
    except InputError as error:
        key = re.search(rf"^[^\w\n]*{re.escape(error.where.removeprefix('$.'))}\W*:", text, re.MULTILINE)
        line = text.count("\n", 0, key.start()) + 1 if key else 1
        hint = error.hint or "expected parameters of a car, such as 'mass: 1.113'"
        raise InputError(path, error.what, line=line, hint=hint) from None
