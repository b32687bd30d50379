"""A spec as it was written: fields that are missing or of a wrong type are None and stand in the diagnostics."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Entry, Mapping, Node, Scalar, read
from dodo_dsl.spec import quantity
from dodo_dsl.spec.registry import Location
from dodo_dsl.spec.schema import quantity_problem, validate

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
    """One ``.dodo.yml``; ``spans`` holds the place of each top-level value."""

    location: Location
    name: str | None = None
    description: str | None = None
    level: str | None = None
    kind: str | None = None
    timeout_s: float | None = None
    clock: str = "realtime"
    isolation: str = "network"
    seed: int = 0
    uses: tuple[Use, ...] = ()
    spans: dict[str, Span] = field(default_factory=dict)

    @property
    def path(self) -> Path:
        return self.location.path

    def span(self, key: str) -> Span:
        return self.spans.get(key, Span(str(self.path)))


def load_spec(location: Location) -> tuple[Spec, list[Diagnostic]]:
    """The spec of a file, as far as it can be read, and everything that its schema finds wrong."""
    node, found = read(location.path)
    if node is None:
        if not found:
            found = [Diagnostic(Span(str(location.path)), "missing-key", "the file is empty, expected a test")]
        return Spec(location), found
    found = [*found, *validate(node, "dodo")]
    if not isinstance(node, Mapping):
        return Spec(location), found
    timeout, problems = _timeout(node.get("timeout"))
    return _spec(location, node, timeout), [*found, *problems]


def _timeout(node: Node | None) -> tuple[float | None, list[Diagnostic]]:
    if not isinstance(node, Scalar) or not isinstance(node.value, str):
        return None, []
    problems = list(quantity_problem(node, "s"))
    if problems:
        return None, problems
    seconds = float(quantity.convert(node.text, "s"))
    if not 0.1 <= seconds <= 86_400:
        return None, [Diagnostic(node.span, "out-of-range", f"'timeout' is {node.text}, expected 0.1 s to 24 h")]
    return seconds, []


def _spec(location: Location, node: Mapping, timeout: float | None) -> Spec:
    def text(key: str, default: Any = None) -> Any:
        value = node.get(key)
        return value.value if isinstance(value, Scalar) and isinstance(value.value, str) else default

    seed = node.get("seed")
    return Spec(
        location,
        name=text("name"),
        description=text("description"),
        level=text("level"),
        kind=text("kind"),
        timeout_s=timeout,
        clock=text("clock", "realtime"),
        isolation=text("isolation", "network"),
        seed=int(seed.value) if isinstance(seed, Scalar) and isinstance(seed.value, int | float) else 0,
        uses=tuple(_uses(node)),
        spans={key: entry.value.span for key, entry in node.entries.items()},
    )


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
