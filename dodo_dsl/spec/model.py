"""A spec as it was written, with its goals, its pool of rigs, and the resources that it allows.

Fields that are missing or of a wrong type are None, and diagnostics report them. Soft goals are scores of checks, by
which ``dodo rank`` compares applications. A pool is ``{any: dynamic}`` or ``{any: [kiwi-1, kiwi-2]}``. ``resources``
are what each service of the application may use of the machine.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Entry, Mapping, Node, Scalar, Sequence
from dodo_dsl.spec import matrix, quantity, vary
from dodo_dsl.spec.matrix import Choice
from dodo_dsl.spec.quantity import SHARE
from dodo_dsl.spec.registry import Location

ANY = "any"


@dataclass(frozen=True)
class Pool:
    """A kind of rigs, all of which will do, or the names of those that will."""

    kind: Scalar | None = None
    names: tuple[Scalar, ...] = ()

    @property
    def text(self) -> str:
        return self.kind.text if self.kind else f"[{', '.join(word.text for word in self.names)}]"


def pool_of(node: Node | None) -> Pool | None:
    """The pool that the value of ``rig`` is; None for a rig's name, and for what the schema refuses."""
    written = node.get(ANY) if isinstance(node, Mapping) else None
    if isinstance(written, Scalar) and isinstance(written.value, str):
        return Pool(kind=written)
    if isinstance(written, Sequence):
        return Pool(names=tuple(item for item in written.items if isinstance(item, Scalar)))
    return None


@dataclass(frozen=True)
class ResourceLimits:
    """Millions of bytes of memory, its growth in such in a minute, seconds on processors, and these by the test's time.

    None if there is no limit.
    """

    max_memory_mb: float | None = None
    max_memory_growth: float | None = None
    max_processor_time_s: float | None = None
    max_processor_share: float | None = None


class ResourceKey(NamedTuple):
    """A key of ``resources``, the field that it sets, its unit and bounds, and these in words."""

    name: str
    field: str
    unit: str
    bounds: tuple[float, float]
    expected: str


KEYS = (
    ResourceKey("max-memory", "max_memory_mb", "MB", (1, 1e6), "1 MB to 1000 GB"),
    ResourceKey("max-memory-growth", "max_memory_growth", "MB/min", (0, 1e6), "0 MB/min to 1000000 MB/min"),
    ResourceKey("max-processor-time", "max_processor_time_s", "s", (0.01, 1e6), "10 ms to 1000000 s"),
    ResourceKey("max-processor-share", "max_processor_share", SHARE, (0.0001, 1000), "0.01 % to 100000 %"),
)


def is_valid(limits: ResourceLimits) -> bool:
    """Whether what was read back is of the right types and within its bounds."""
    values = ((getattr(limits, key.field), key.bounds) for key in KEYS)
    return all(
        value is None or (isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high)
        for value, (low, high) in values
    )


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
_MAPPINGS = (
    *LAYERS,
    matrix.KEY,
    vary.KEY,
    "record",
    "response",
    "resources",
    "application",
    "goals",
    "baseline",
    "rig",
)
MAX_SERVICES = 100
"""In a layer, as in the schema."""


@dataclass(frozen=True)
class Use:
    """A service in a layer: ``name: {uses: ..., with: {...}}``."""

    layer: str
    name: str
    span: Span
    uses: Scalar
    parameters: dict[str, Entry] = field(default_factory=dict)


VIRTUAL = "virtual"
STEPPED_CLOCKS = ("lockstep", VIRTUAL)


@dataclass(frozen=True)
class Spec:
    """One instance of a ``.dodo.yml``; ``spans`` holds the place of each top-level value.

    ``pool`` shows which rigs will do where the spec names none, and the deployment shows which ones these are.
    ``isolation`` is None if the spec leaves it to the rig. With ``pose`` ``hidden`` the application must not declare
    to take what only a simulation knows. ``frames`` is one of FRAMES, ``frames_hz`` None for the cameras' own rates.
    ``record_limit_mb`` is the largest size of the recording in millions of bytes, None for the recorder's default.
    ``max_response_s`` is the longest that an answer may take in lockstep, but for a share ``response_over`` of them.
    ``resources`` are the limits of what each of the application's services uses, None without any.
    ``variables`` are those that the application gets from the test, ``goals`` the soft ones by the names of checks.
    ``baseline`` names an earlier result, than which checks must not be worse.
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
    clock: str = "realtime"
    rig: str | None = None
    pool: Pool | None = None
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
    baseline: Entry | None = None
    choice: Choice = field(default_factory=Choice)
    spans: dict[str, Span] = field(default_factory=dict)
    is_whole: bool = True
    ranges: tuple[vary.Range, ...] = ()
    template: Mapping | None = field(default=None, repr=False)
    corners: tuple["Spec", ...] = field(default=(), repr=False)
    unfilled: frozenset[Span] = field(default=frozenset(), repr=False)

    @property
    def path(self) -> Path:
        return self.location.path

    @property
    def title(self) -> str:
        """The instance's name: ``name[light=dark]``"""
        return (self.name or self.location.stem) + self.choice.label

    @property
    def slug(self) -> str:
        """The instance's name in folders, projects and jobs: ``name--light-dark``"""
        return (self.name or self.location.stem) + self.choice.slug

    @property
    def is_stepped(self) -> bool:
        """Whether the world waits for the application: in lockstep, with its own time or the test's."""
        return self.clock in STEPPED_CLOCKS

    def span(self, key: str) -> Span:
        return self.spans.get(key, Span(str(self.path)))


def _number(node: Node | None, unit: str) -> float | None:
    """A quantity in its unit, or None when it is not one, which the schema reports."""
    try:
        return float(quantity.convert(node.text, unit)) if isinstance(node, Scalar) else None
    except quantity.QuantityError:
        return None


def _within(
    node: Node | None, key: str, unit: str, bounds: tuple[float, float], expected: str
) -> tuple[float | None, list[Diagnostic]]:
    """A quantity in its unit, None when it is not one, with the problem of one that is out of range."""
    value = _number(node, unit)
    if value is not None and node is not None and not bounds[0] <= value <= bounds[1]:
        text = node.text if isinstance(node, Scalar) else ""
        return None, [Diagnostic(node.span, "out-of-range", f"'{key}' is {text}, expected {expected}")]
    return value, []


def _seed(node: Node | None) -> int:
    value = node.value if isinstance(node, Scalar) else None
    return int(value) if isinstance(value, int | float) and math.isfinite(value) else 0


def _part(node: Node | None, key: str) -> Node | None:
    return node.get(key) if isinstance(node, Mapping) else None


def _frames(node: Node | None) -> tuple[str, float | None, list[Diagnostic]]:
    """When frames are kept, their rate in Hz, and problems; a rate in place of the word means always."""
    frames = _part(node, "frames")
    written = frames.value if isinstance(frames, Scalar) else ON_FAILURE
    word = written if isinstance(written, str) and written in FRAMES else ALWAYS
    bounds, expected = (0.01, 1000), "0.01 Hz to 1 kHz"
    rate, found = _within(_part(node, "rate"), "rate", "Hz", bounds, expected)
    if written not in FRAMES:
        rate, found = _within(frames, "frames", "Hz", bounds, expected)
    return word, rate, found


def spec_of(location: Location, node: Mapping, choice: Choice, is_whole: bool) -> tuple[Spec, list[Diagnostic]]:
    """An instance from its values, which have no placeholders any more, and problems that no rule checks."""

    def text(key: str, default: Any = None) -> Any:
        value = node.get(key)
        return value.value if isinstance(value, Scalar) and isinstance(value.value, str) else default

    uses = tuple(_uses(node))
    response = node.get("response")
    timeout, found = _within(node.get("timeout"), "timeout", "s", (0.1, 86_400), "0.1 s to 24 h")
    longest, more = _within(_part(response, "max"), "max", "s", (0.0001, 3600), "0.1 ms to 1 h")
    largest, also = _within(_part(node.get("record"), "limit"), "limit", "MB", (1, 100_000), "1 MB to 100 GB")
    frames, rate, wrong = _frames(node.get("record"))
    resources, exceeding = _resources(node.get("resources"))
    over, most = _within(_part(response, "over"), "over", quantity.SHARE, (0, 1), "0 % to 100 %")
    spec = Spec(
        location,
        name=text("name"),
        description=" ".join(description.split()) if (description := text("description")) else None,
        level=text("level"),
        kind=text("kind"),
        timeout_s=timeout,
        clock=text("clock", "realtime"),
        rig=text("rig"),
        pool=pool_of(node.get("rig")),
        isolation=text("isolation"),
        pose=text("pose", "declared"),
        seed=_seed(node.get("seed")),
        frames=frames,
        frames_hz=rate,
        record_limit_mb=largest,
        max_response_s=longest,
        response_over=over or 0.0,
        resources=resources,
        copies_times=_part(response, "sample-times") is not None,
        uses=uses,
        variables=_variables(node.get("application")),
        goals=dict(goals.entries) if isinstance(goals := node.get("goals"), Mapping) else {},
        baseline=node.entries.get("baseline"),
        choice=choice,
        spans={key: entry.value.span for key, entry in node.entries.items()},
        is_whole=is_whole and len(uses) == _written_services(node) and not _has_stranger(node),
    )
    return spec, [*found, *more, *also, *wrong, *exceeding, *most]


def _resources(node: Node | None) -> tuple[ResourceLimits | None, list[Diagnostic]]:
    """The limits of what services use, and the problems of those that are out of range."""
    if not isinstance(node, Mapping):
        return None, []
    read = {key.field: _within(node.get(key.name), key.name, *key[2:]) for key in KEYS}
    problems = [problem for _, found in read.values() for problem in found]
    return ResourceLimits(**{name: value for name, (value, _) in read.items()}), problems


def _variables(application: Node | None) -> dict[str, Entry]:
    written = _part(application, "env")
    return dict(written.entries) if isinstance(written, Mapping) else {}


def _has_stranger(node: Mapping) -> bool:
    """Whether an unknown key holds a mapping, most likely a layer with a misspelt name."""
    return any(k not in _MAPPINGS and isinstance(e.value, Mapping) for k, e in node.entries.items())


def _written_services(node: Mapping) -> int:
    """The number of services written; a layer that is not a mapping counts as one, which cannot be read."""
    layers = [layer for name in LAYERS if (layer := node.get(name)) is not None]
    return sum(len(layer.entries) if isinstance(layer, Mapping) else 1 for layer in layers)


def _uses(node: Mapping) -> Iterator[Use]:
    for layer in LAYERS:
        services = node.get(layer)
        if not isinstance(services, Mapping):
            continue
        for name, entry in itertools.islice(services.entries.items(), MAX_SERVICES):
            if not isinstance(entry.value, Mapping):
                continue
            uses, parameters = entry.value.get("uses"), entry.value.get("with")
            if isinstance(uses, Scalar) and isinstance(uses.value, str):
                written = parameters.entries if isinstance(parameters, Mapping) else {}
                yield Use(layer, name, entry.key, uses, written)


@dataclass(frozen=True)
class Goal:
    """A check that scores 0 at ``zero``, 1 at ``one``, both in its unit, and linearly between; never beyond."""

    check: str
    zero: float
    one: float
    weight: float = 1.0

    def score(self, value: float | None) -> float:
        """Of a value, 0 to 1; a check without a value scores 0."""
        if value is None:
            return 0.0
        return min(1.0, max(0.0, (value - self.zero) / (self.one - self.zero)))


BASELINE = "baseline-"
"""How the names of checks begin that compare with an earlier result: ``baseline-mean``."""


@dataclass(frozen=True)
class RecordedValue:
    """What a check was in an earlier result, by how much of that it may be worse, and its number among its name."""

    check: str
    value: float
    tolerance: float
    number: int = 0


def is_goal(goal: Goal) -> bool:
    """Whether its numbers make a score; those of a file may be anything."""
    numbers = (goal.zero, goal.one, goal.weight)
    if not all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
        return False
    return goal.weight > 0 and goal.zero != goal.one
