"""A spec as it was written, with its goals and the resources that it allows."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Entry, Mapping, Scalar, entries, part
from dodo_dsl.spec import vary
from dodo_dsl.spec.matrix import Choice
from dodo_dsl.spec.registry import Location
from dodo_dsl.spec.validation import schema_of_keys, values


@dataclass(frozen=True)
class ResourceLimits:
    """Millions of bytes of memory, seconds on processors, and these by the test's time.

    None if there is no limit.
    """

    max_memory_mb: float | None = None
    max_processor_time_s: float | None = None
    max_processor_share: float | None = None


_RESOURCES = ("max-memory", "max-processor-time", "max-processor-share")
_PLAIN = ("name", "level", "kind", "clock", "rig", "isolation", "pose", "seed", "headline", "until")
_VALUES = (*_PLAIN, "description", "timeout", "record", "response", "resources")


LAYERS = ("environment", "action", "evaluation")
"""Of services, in the order in which they are set up; the application comes after them."""
LEVEL_WORDS = {
    "sil": "software in the loop: the world is simulated",
    "dil": "data in the loop: the world is recorded",
    "hil": "hardware in the loop: the world is real",
}
LEVELS = tuple(LEVEL_WORDS)
KINDS = ("perception", "open-loop", "closed-loop")
FRAMES = (ALWAYS, ON_FAILURE, NEVER) = ("always", "on-failure", "never")
"""When the frames of a test's cameras are kept."""


@dataclass(frozen=True)
class Use:
    layer: str
    name: str
    span: Span
    uses: Scalar
    parameters: dict[str, Entry] = field(default_factory=dict)


REALTIME, LOCKSTEP = "realtime", "lockstep"
CLOCKS = {REALTIME: REALTIME, LOCKSTEP: LOCKSTEP, "virtual": LOCKSTEP}
"""What may be written, and what it means; ``virtual`` is another word until 1.0."""


@dataclass(frozen=True)
class Spec:
    """One instance of a ``.dodo.yml``; ``spans`` holds the place of each top-level value.

    ``pool`` is the kind of several rigs, any of which will do, and ``rig`` one of them.
    ``until`` is the evaluator whose verdict ends the test, if one does.
    ``isolation`` is None if the spec leaves it to the rig. With ``pose`` ``hidden`` the application must not declare
    to take what only a simulation knows. ``frames`` is one of FRAMES, ``frames_hz`` None for the cameras' own rates.
    ``record_limit_mb`` is the largest size of the recording in millions of bytes, None for the recorder's default.
    ``max_response_s`` is the longest that an answer may take in lockstep, but for a share ``response_over`` of them.
    ``resources`` are the limits of what each of the application's services uses, None without any.
    ``variables`` are those that the application gets from the test, ``goals`` the soft ones by the names of checks.
    ``is_whole`` is False if services could not be read, so that missing producers are not reported.
    ``ranges`` are those of ``vary``, ``template`` is the instance before their values were filled in, and ``corners``
    are the same instance at the ends of the ranges, which are checked but never run.
    """

    location: Location
    name: str | None = None
    description: str | None = None
    level: str | None = None
    kind: str | None = None
    timeout_s: float | None = None
    until: str = ""
    clock: str = REALTIME
    rig: str | None = None
    pool: str = ""
    isolation: str | None = None
    pose: str = "declared"
    seed: int = 0
    frames: str = ON_FAILURE
    frames_hz: float | None = None
    record_limit_mb: float | None = None
    max_response_s: float | None = None
    response_over: float = 0.0
    copies_times: bool = False
    resources: ResourceLimits | None = None
    uses: tuple[Use, ...] = ()
    variables: dict[str, Entry] = field(default_factory=dict)
    goals: dict[str, Entry] = field(default_factory=dict)
    headline: str = ""
    choice: Choice = field(default_factory=Choice)
    spans: dict[str, Span] = field(default_factory=dict)
    is_whole: bool = True
    ranges: tuple[vary.Range, ...] = ()
    template: Mapping | None = field(default=None, repr=False)
    corners: tuple["Spec", ...] = field(default=(), repr=False)

    @property
    def path(self) -> Path:
        return self.location.path

    @property
    def title(self) -> str:
        """The instance's name: ``name[light=dark]``"""
        return (self.name or self.location.stem) + self.choice.label

    @property
    def slug(self) -> str:
        return (self.name or self.location.stem) + self.choice.slug

    @property
    def is_stepped(self) -> bool:
        return self.clock == LOCKSTEP

    def span(self, key: str) -> Span:
        return self.spans.get(key, Span(str(self.path)))


def spec_of(location: Location, node: Mapping, choice: Choice, spans: dict[str, Span], is_whole: bool) -> Spec:
    known = schema_of_keys("dodo")["properties"]
    raw = {key: values(entry.value, known[key]) for key, entry in node.entries.items() if key in _VALUES}
    record, response, resources = (raw.get(key, {}) for key in ("record", "response", "resources"))
    frames = record.get("frames", ON_FAILURE)
    is_rate = frames not in FRAMES
    return Spec(
        location,
        **{key: raw[key] for key in _PLAIN if key in raw and key != "clock"},
        clock=CLOCKS[raw.get("clock", REALTIME)],
        description=" ".join(raw.get("description", "").split()) or None,
        timeout_s=raw.get("timeout"),
        frames=ALWAYS if is_rate else frames,
        frames_hz=frames if is_rate else record.get("rate"),
        record_limit_mb=record.get("limit"),
        max_response_s=response.get("max"),
        response_over=response.get("over", 0.0),
        copies_times="sample-times" in response,
        resources=ResourceLimits(*map(resources.get, _RESOURCES)) if "resources" in raw else None,
        uses=tuple(_uses(node)),
        variables=entries(node, "application", "env"),
        goals=entries(node, "goals"),
        choice=choice,
        spans=spans,
        is_whole=is_whole,
    )


def _uses(node: Mapping) -> Iterator[Use]:
    for layer in LAYERS:
        for name, entry in entries(node, layer).items():
            uses = part(entry.value, "uses")
            if isinstance(uses, Scalar):
                yield Use(layer, name, entry.key, uses, entries(entry.value, "with"))


_MOST_WEIGHT = 1000


@dataclass(frozen=True)
class Goal:
    """A check that scores 0 at ``zero``, 1 at ``one``, both in its unit, and linearly between; never beyond."""

    check: str
    """Name of the check whose value is scored."""
    zero: float
    """Value that scores 0, in the check's unit."""
    one: float
    """Value that scores 1, in the check's unit."""
    weight: float = 1.0
    """Weight of the goal among those of its test: above 0, at most 1000."""

    def score(self, value: float | None) -> float:
        """Of a value, 0 to 1; a check without a value scores 0."""
        if value is None:
            return 0.0
        return min(1.0, max(0.0, (value - self.zero) / (self.one - self.zero)))


def is_goal(goal: Goal) -> bool:
    """Whether its numbers make a score; those of a file may be anything."""
    numbers = (goal.zero, goal.one, goal.weight)
    if not all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
        return False
    return 0 < goal.weight <= _MOST_WEIGHT and goal.zero != goal.one
