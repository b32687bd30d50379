"""Random values that fit a ROS type, by the definitions of its fields."""

import math
import random
from typing import Any

import numpy as np

from dodo_dsl.opendlv.ros_codec import Codec
from dodo_dsl.opendlv.ros_types import CLOCK_TYPE, GIVEN, NUMBERS, SENT, STATIC_FRAMES_TYPE

CARRIED = sorted({CLOCK_TYPE, STATIC_FRAMES_TYPE, *GIVEN, *SENT, *NUMBERS})


def some_fields(codec: Codec, type_: str, rng: random.Random) -> dict[str, Any]:
    return {name: _some(codec, desc, rng) for name, desc in codec.store.fielddefs[type_][1]}


def _some(codec: Codec, desc: Any, rng: random.Random) -> Any:
    kind, of = desc
    if kind == 2:
        return some_fields(codec, of, rng)
    if kind == 1:
        return _scalar(of[0], rng)
    count = of[1] if kind == 3 else rng.choice([0, 1, 3])
    found = [_some(codec, of[0], rng) for _ in range(count)]
    is_number = of[0][0] == 1 and of[0][1][0] != "string"
    return np.array(found, np.dtype({"bool": "bool_"}.get(of[0][1][0], of[0][1][0]))) if is_number else found


def _scalar(base: str, rng: random.Random) -> Any:
    if base == "string":
        return rng.choice(["", "base_link", "Tür \N{SNOWMAN}"])
    if base == "bool":
        return rng.random() < 0.5
    if base.startswith("float"):
        value = rng.choice([0.0, -1.5, math.inf, rng.uniform(-1e6, 1e6), 5e-324])
        return float(np.float32(value)) if base == "float32" else value
    limits = np.iinfo(base)
    return rng.choice([int(limits.min), 0, int(limits.max), rng.randrange(int(limits.min), int(limits.max))])


def plain(value: Any) -> Any:
    """Fields with lists instead of arrays, to be compared and to be written as JSON."""
    if isinstance(value, dict):
        return {name: plain(each) for name, each in value.items()}
    if isinstance(value, list | np.ndarray):
        return [plain(each) for each in value]
    return value.item() if isinstance(value, np.generic) else value
