"""``matrix``: an instance of a spec for each choice of values, which replace placeholders as ``${matrix.light}``."""

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass

from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.source import Entry, Mapping, Node, Scalar, Sequence, walk

KEY = "matrix"
MAX_INSTANCES = 2_000
MAX_SLUG = 180

_PLACEHOLDER = re.compile(r"\$\{matrix\.(?P<name>[a-z][a-z0-9-]*)\}")
_ATTEMPT = re.compile(r"\$\{\s*matrix\b[^}]*\}?")
_NOT_SLUG = re.compile(r"[^a-z0-9]+")
SLUG = re.compile(r"[a-z0-9]+(-+[a-z0-9]+)*")
"""The slug of any test or instance."""


@dataclass(frozen=True)
class Choice:
    """One value of each dimension, in the order in which the dimensions are written; empty without a matrix."""

    values: tuple[tuple[str, Scalar], ...] = ()

    @property
    def label(self) -> str:
        """``[light=dark,speed=2]``"""
        return f"[{','.join(f'{k}={v.text}' for k, v in self.values)}]" if self.values else ""

    @property
    def slug(self) -> str:
        """``--light-dark--speed-2``"""
        return "".join(f"--{k}-{_slug(v.text)}" for k, v in self.values)


def _slug(text: str) -> str:
    return _NOT_SLUG.sub("-", text.lower()).strip("-")


def choices(node: Node) -> tuple[list[Choice], list[Diagnostic]]:
    """Every choice of a spec's matrix (one, empty, without a matrix), and the problems of its values.

    Problems that the schema reports are left out.
    """
    entry = node.entries.get(KEY) if isinstance(node, Mapping) else None
    if entry is None or not isinstance(entry.value, Mapping):
        return [Choice()], []
    dimensions = {
        name: [v for v in dimension.value.items if isinstance(v, Scalar) and v.value is not None]
        for name, dimension in entry.value.entries.items()
        if isinstance(dimension.value, Sequence)
    }
    found = [problem for name, values in dimensions.items() for problem in _alike(name, values)]
    number = 1
    for values in dimensions.values():
        number *= len(values)
    if number > MAX_INSTANCES:
        message = f"the matrix has {number} instances, expected at most {MAX_INSTANCES}"
        hint = "choose fewer values, or write several tests that extend this one"
        return [Choice()], [*found, Diagnostic(entry.key, "matrix-size", message, hint)]
    names = tuple(dimensions)
    product = [Choice(tuple(zip(names, values, strict=True))) for values in itertools.product(*dimensions.values())]
    if product and len(product[0].slug) > MAX_SLUG:
        message = (
            f"the names of the instances' folders are longer than {MAX_SLUG} characters: '{product[0].slug[:40]}...'"
        )
        found.append(Diagnostic(entry.key, "matrix-size", message, "use shorter or fewer names and values"))
    return product or [Choice()], found


def _alike(name: str, values: list[Scalar]) -> Iterator[Diagnostic]:
    seen: dict[str, Scalar] = {}
    for value in values:
        slug = _slug(value.text)
        if not slug:
            message = f"'{value.text}' has no letter or digit, so it cannot name an instance of '{name}'"
            yield Diagnostic(value.span, "matrix-value", message)
        elif slug in seen:
            message = f"'{value.text}' and '{seen[slug].text}' of '{name}' would both be called '{slug}'"
            yield Diagnostic(value.span, "matrix-value", message)
        seen.setdefault(slug, value)


def placeholders(node: Node) -> set[str]:
    """The dimensions that placeholders below a node name."""
    return {m["name"] for n in walk(node) if isinstance(n, Scalar) for m in _PLACEHOLDER.finditer(n.text)}


def problems(node: Mapping) -> Iterator[Diagnostic]:
    """Placeholders of unknown dimensions, and dimensions without placeholders."""
    entry = node.entries.get(KEY)
    dimensions = entry.value.entries if entry and isinstance(entry.value, Mapping) else {}
    used: set[str] = set()
    for key, part in node.entries.items():
        if key == KEY:
            continue
        for scalar in walk(part.value):
            if isinstance(scalar, Scalar) and "${" in scalar.text:
                used |= {m["name"] for m in _PLACEHOLDER.finditer(scalar.text)}
                yield from _unknown(scalar, dimensions)
    for name, dimension in dimensions.items():
        if name not in used:
            message = f"nothing uses ${{matrix.{name}}}, so its instances are all the same"
            yield Diagnostic(dimension.key, "matrix-unused", message, severity="warning")


def _unknown(scalar: Scalar, dimensions: dict[str, Entry]) -> Iterator[Diagnostic]:
    for attempt in _ATTEMPT.finditer(scalar.text):
        match = _PLACEHOLDER.fullmatch(attempt[0])
        if match is None:
            message = f"'{attempt[0][:60]}' is not a placeholder, expected one such as ${{matrix.light}}"
            yield Diagnostic(scalar.span, "matrix-unknown", message)
        elif match["name"] not in dimensions:
            hint = did_you_mean(match["name"], dimensions) if dimensions else "add it with its values under 'matrix'"
            yield Diagnostic(scalar.span, "matrix-unknown", f"the matrix has no dimension '{match['name']}'", hint)


def substitute(node: Node, choice: Choice) -> Node:
    """The node with the choice's values for the placeholders; nodes without placeholders stay the same objects."""
    return _substitute(node, dict(choice.values)) if choice.values else node


def _substitute(node: Node, values: dict[str, Scalar]) -> Node:
    if isinstance(node, Scalar):
        return _scalar(node, values)
    if isinstance(node, Sequence):
        items = tuple(_substitute(item, values) for item in node.items)
        same = all(a is b for a, b in zip(items, node.items, strict=True))
        return node if same else Sequence(node.span, items, node.tag)
    entries = {}
    changed = False
    for key, entry in node.entries.items():
        value = _substitute(entry.value, values)
        changed = changed or value is not entry.value
        entries[key] = entry if value is entry.value else Entry(entry.key, value)
    return Mapping(node.span, entries, node.tag) if changed else node


def _scalar(node: Scalar, values: dict[str, Scalar]) -> Scalar:
    if "${" not in node.text:
        return node
    whole = _PLACEHOLDER.fullmatch(node.text)
    if whole:
        chosen = values.get(whole["name"])
        return Scalar(node.span, chosen.value, chosen.text, node.tag) if chosen else node
    text = _PLACEHOLDER.sub(lambda m: values[m["name"]].text if m["name"] in values else m[0], node.text)
    return Scalar(node.span, text, text, node.tag)
