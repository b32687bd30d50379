"""The limits of a rig's motion by its repository, as the operator of the machine measures them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from dodo_dsl.spec.deployment.rig import CIRCLE, MEMORY_FLAG

LIMIT_FLAGS = {
    "x": "range-x",
    "y": "range-y",
    "yaw": "range-yaw",
    "speed": "max-speed",
    "yaw-rate": "max-yaw-rate",
    "acceleration": "max-acceleration",
    "yaw-acceleration": "max-yaw-acceleration",
}
"""The gantry's flags for the operator's limits; they have the same units."""
RANGES = ("x", "y", "yaw")
BUILT_IN = {"steps-x": 3320.0, "steps-y": 3320.0, "steps-yaw": 0.55, "offset-yaw": 83.0}
"""The firmware's constants, by the gantry's flags: full steps per m, m, degree, and from home to heading 0."""
BUILT_IN_CIRCLE = {**BUILT_IN, "steps-yaw": 200 / 360, "offset-yaw": 100.0}


@dataclass(frozen=True)
class Motion:
    """``limits`` in the operator's units, of which one that is missing is unlimited; ``constants`` that differ."""

    limits: Mapping[str, float]
    constants: Mapping[str, float] = field(default_factory=dict)
    circle: bool = False

    def by(self, constants: Mapping[str, float]) -> dict[str, float]:
        """The limits as they are by the repository's own constants or by others, whichever are larger.

        A repository that says of a rig that its steps are longer would else get it to go farther.
        """
        built = BUILT_IN_CIRCLE if self.circle else BUILT_IN
        own, theirs = {**built, **self.constants}, {**built, **constants}
        x, y, yaw = (own[name] / theirs[name] for name in ("steps-x", "steps-y", "steps-yaw"))
        shares = {"x": x, "y": y, "yaw": yaw, "speed": max(x, y), "acceleration": max(x, y)}
        shift = 0.0 if self.circle else abs(own["offset-yaw"] - theirs["offset-yaw"]) / theirs["steps-yaw"]
        found = {}
        for name, limit in self.limits.items():
            share = shares.get(name, yaw)
            found[name] = max(limit, limit * share + (shift if name == "yaw" and limit else 0.0))
        return found


STILL = Motion(dict.fromkeys(LIMIT_FLAGS, 0.0))
"""Nothing moves."""


def motion_of(words: Mapping[str, str], manual: bool = False) -> Motion:
    """The motion by the gantry's flags: what it does itself, and what it has the rig's memory keep for others.

    Of a ``manual`` motion speeds and accelerations are those that the memory keeps.
    """
    circle = words.get("kind") == CIRCLE
    kept = _kept(words.get(MEMORY_FLAG, ""))
    limits = {}
    for name, flag in LIMIT_FLAGS.items():
        own = 0.0 if manual and name not in RANGES else math.inf
        limits[name] = max(_number(words[flag]) if flag in words else own, kept.get(name, math.inf))
    constants = {name: _number(words[name]) for name in BUILT_IN if name in words}
    return Motion(limits | ({"yaw": math.inf} if circle else {}), constants, circle)


def _kept(text: str) -> dict[str, float]:
    """The limits for the memory in the operator's units; one that cannot be read counts as unlimited."""
    found = {}
    for word in text.split(","):
        name, _, number = word.partition("=")
        found[name] = math.degrees(_number(number)) if name == "yaw" else _number(number)
    return found


def _number(text: str) -> float:
    """A number of a compiled file, which anyone may have changed; what is none, such as "nan", bounds nothing."""
    try:
        value = float(text)
    except ValueError:
        return math.inf
    return value if math.isfinite(value) else math.inf
