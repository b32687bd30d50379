"""A spec as it was written: fields that are missing or of a wrong type are None and stand in the diagnostics."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Entry, Mapping, Node, Scalar, read
from dodo_dsl.spec import extends, matrix, quantity
from dodo_dsl.spec.matrix import Choice
from dodo_dsl.spec.registry import Location
from dodo_dsl.spec.schema import validate

LAYERS = ("environment", "action", "evaluation")


@dataclass(frozen=True)
class Use:
    """A service in a layer: ``name: {uses: ..., with: {...}}``."""

    layer: str
    name: str
    span: Span
    uses: Scalar
    parameters: dict[str, Entry] = field(default_factory=dict)


@dataclass(frozen=True)
class Spec:
    """One instance of a ``.dodo.yml``; ``spans`` holds the place of each top-level value.

    ``isolation`` is None where the spec leaves it to the rig, ``frames_hz`` is 0 where no frames are recorded.
    """

    location: Location
    name: str | None = None
    description: str | None = None
    level: str | None = None
    kind: str | None = None
    timeout_s: float | None = None
    clock: str = "realtime"
    rig: str | None = None
    isolation: str | None = None
    seed: int = 0
    frames_hz: float = 0.0
    uses: tuple[Use, ...] = ()
    choice: Choice = field(default_factory=Choice)
    spans: dict[str, Span] = field(default_factory=dict)

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

    def span(self, key: str) -> Span:
        return self.spans.get(key, Span(str(self.path)))


def load_spec(location: Location) -> tuple[list[Spec], list[Diagnostic]]:
    """The instances of a file, as far as it can be read, and everything that its schema finds wrong."""
    node, found = read(location.path)
    if node is None:
        if not found:
            found = [Diagnostic(Span(str(location.path)), "missing-key", "the file is empty, expected a test")]
        return [Spec(location)], found
    node, problems = extends.resolve(node, location.path, location.root)
    found = [*found, *problems]
    choices, problems = matrix.choices(node)
    found.extend(problems)
    if not isinstance(node, Mapping):
        return [Spec(location)], [*found, *validate(node, "dodo")]
    found.extend(matrix.problems(node))
    specs = []
    checked_by_rules = _only_in_parameters(node)
    for number, choice in enumerate(choices):
        instance = matrix.substitute(node, choice)
        assert isinstance(instance, Mapping)
        if number == 0 or not checked_by_rules:
            found.extend(validate(instance, "dodo"))
        spec, problems = _spec(location, instance, choice)
        found.extend(problems)
        specs.append(spec)
    return specs, found


def _only_in_parameters(node: Mapping) -> bool:
    """Whether all placeholders stand under ``with``: rules look at those values, so one instance's schema is all's."""
    for key, entry in node.entries.items():
        if key in LAYERS and isinstance(entry.value, Mapping):
            for use in entry.value.entries.values():
                if not isinstance(use.value, Mapping) or matrix.placeholders(_without_parameters(use.value)):
                    return False
        elif key != matrix.KEY and matrix.placeholders(entry.value):
            return False
    return True


def _without_parameters(use: Mapping) -> Mapping:
    return Mapping(use.span, {key: entry for key, entry in use.entries.items() if key != "with"})


def _number(node: Node | None, unit: str) -> float | None:
    """A quantity in its unit, or None when it is none (and the schema says so)."""
    try:
        return float(quantity.convert(node.text, unit)) if isinstance(node, Scalar) else None
    except quantity.QuantityError:
        return None


def _timeout(node: Node | None) -> tuple[float | None, list[Diagnostic]]:
    seconds = _number(node, "s")
    if seconds is not None and node is not None and not 0.1 <= seconds <= 86_400:
        text = node.text if isinstance(node, Scalar) else ""
        return None, [Diagnostic(node.span, "out-of-range", f"'timeout' is {text}, expected 0.1 s to 24 h")]
    return seconds, []


def _frames(node: Node | None) -> float:
    return (_number(node.get("frames"), "Hz") if isinstance(node, Mapping) else None) or 0.0


def _spec(location: Location, node: Mapping, choice: Choice) -> tuple[Spec, list[Diagnostic]]:
    def text(key: str, default: Any = None) -> Any:
        value = node.get(key)
        return value.value if isinstance(value, Scalar) and isinstance(value.value, str) else default

    seed = node.get("seed")
    timeout, found = _timeout(node.get("timeout"))
    spec = Spec(
        location,
        name=text("name"),
        description=text("description"),
        level=text("level"),
        kind=text("kind"),
        timeout_s=timeout,
        clock=text("clock", "realtime"),
        rig=text("rig"),
        isolation=text("isolation"),
        seed=int(seed.value) if isinstance(seed, Scalar) and isinstance(seed.value, int | float) else 0,
        frames_hz=_frames(node.get("record")),
        uses=tuple(_uses(node)),
        choice=choice,
        spans={key: entry.value.span for key, entry in node.entries.items()},
    )
    return spec, found


def _uses(node: Mapping) -> Iterator[Use]:
    for layer in LAYERS:
        services = node.get(layer)
        if not isinstance(services, Mapping):
            continue
        for name, entry in services.entries.items():
            if not isinstance(entry.value, Mapping):
                continue
            uses, parameters = entry.value.get("uses"), entry.value.get("with")
            if isinstance(uses, Scalar) and isinstance(uses.value, str):
                written = parameters.entries if isinstance(parameters, Mapping) else {}
                yield Use(layer, name, entry.key, uses, written)
