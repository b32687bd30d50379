"""``matrix``: an instance of a spec for each choice of values, which replace placeholders as ``${matrix.light}``."""

import functools
import itertools
import math
import re
from collections.abc import Iterator
from collections.abc import Mapping as Values
from dataclasses import dataclass

from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.source import Entry, Mapping, Node, Scalar, Sequence, walk

MATRIX = "matrix"
_RULE = "unknown-placeholder"
REPORTED = "\0"
"""The tag of values with a problem that is known already, which no file can have."""


def without(node: Mapping, key: str) -> Mapping:
    return Mapping(node.span, {name: entry for name, entry in node.entries.items() if name != key}, node.tag)


@dataclass(frozen=True)
class Placeholders:
    """Those of one ``key`` of specs; ``advice`` is the hint if it has no names at all.

    With ``points_at_value`` a value that replaces a whole scalar keeps its own position, so that problems are shown
    there and not at the placeholder.
    """

    key: str
    advice: str
    points_at_value: bool = False

    @functools.cached_property
    def _one(self) -> re.Pattern[str]:
        return re.compile(rf"\$\{{{self.key}\.(?P<name>[a-z][a-z0-9-]*)\}}")

    @functools.cached_property
    def _attempt(self) -> re.Pattern[str]:
        """What is meant as a placeholder, also as other tools have them."""
        return re.compile(rf"\$\{{{{1,2}}\s*{self.key}\b(?:\.(?P<name>[a-z][a-z0-9-]*))?[^}}]*\}}?")

    def names(self, node: Node) -> set[str]:
        texts = (below.text for below in walk(node) if isinstance(below, Scalar))
        return {match["name"] for text in texts for match in self._one.finditer(text)}

    def used(self, node: Mapping) -> set[str]:
        return self.names(without(node, self.key))

    def _known(self, node: Mapping) -> dict[str, Entry]:
        written = node.get(self.key)
        return written.entries if isinstance(written, Mapping) else {}

    def idle(self, node: Mapping) -> Iterator[Diagnostic]:
        """Names without placeholders, unless ranges come from an extended test."""
        used = self.used(node)
        for name, entry in self._known(node).items():
            if name not in used and (self.key == MATRIX or entry.key.file == node.span.file):
                message = f"nothing uses ${{{self.key}.{name}}}, so that its values change nothing"
                yield Diagnostic(entry.key, "unused-placeholder", message, severity="warning")

    def unknown(self, node: Mapping) -> Iterator[Diagnostic]:
        """Placeholders of a spec with names that are not known, or without one."""
        known = self._known(node)
        values = (entry.value for key, entry in node.entries.items() if key != self.key)
        for scalar in (one for value in values for one in walk(value) if isinstance(one, Scalar)):
            for attempt in self._attempt.finditer(scalar.text) if "${" in scalar.text else ():
                name = attempt["name"]
                right = f"${{{self.key}.{name if name in known else 'light'}}}"
                if not self._one.fullmatch(attempt[0]):
                    message = f"'{attempt[0][:60]}' is not a placeholder, expected one such as {right}"
                    yield Diagnostic(scalar.span, _RULE, message, f'write "{right}"' if name in known else "")
                elif name not in known:
                    hint = did_you_mean(name, known) if known else self.advice
                    yield Diagnostic(scalar.span, _RULE, f"'{self.key}' has no '{name}'", hint)

    def filled(self, node: Mapping, values: Values[str, Scalar]) -> Mapping:
        """The node with values for the placeholders; nodes without placeholders stay the same objects.

        A spec's matrix, which may be large, stays as it is: its values are filled where they are used. A scalar with a
        placeholder that has no value gets the tag REPORTED, as nothing more can be said of it.
        """
        kept = {key: entry for key, entry in node.entries.items() if key in (MATRIX, self.key)}
        filled = self._filled(Mapping(node.span, {k: e for k, e in node.entries.items() if k not in kept}), values)
        assert isinstance(filled, Mapping)
        return Mapping(node.span, {key: kept.get(key) or filled.entries[key] for key in node.entries}, node.tag)

    def _filled(self, node: Node, values: Values[str, Scalar]) -> Node:
        if isinstance(node, Scalar):
            return self._scalar(node, values)
        if isinstance(node, Sequence):
            items = tuple(self._filled(item, values) for item in node.items)
            same = all(a is b for a, b in zip(items, node.items, strict=True))
            return node if same else Sequence(node.span, items, node.tag)
        entries = {}
        changed = False
        for key, entry in node.entries.items():
            value = self._filled(entry.value, values)
            changed = changed or value is not entry.value
            entries[key] = entry if value is entry.value else Entry(entry.key, value)
        return Mapping(node.span, entries, node.tag) if changed else node

    def _scalar(self, node: Scalar, values: Values[str, Scalar]) -> Scalar:
        if "${" not in node.text or not self._attempt.search(node.text):
            return node
        whole = self._one.fullmatch(node.text)
        if whole and (chosen := values.get(whole["name"])):
            span = chosen.span if self.points_at_value else node.span
            return Scalar(span, chosen.value, chosen.text, node.tag)
        text = self._one.sub(lambda m: values[m["name"]].text if m["name"] in values else m[0], node.text)
        return Scalar(node.span, text, text, REPORTED if self._attempt.search(text) else node.tag)


KEY = MATRIX
MAX_INSTANCES = 2_000
MAX_SLUG = 180

PLACEHOLDERS = Placeholders(KEY, "add it with its values under 'matrix'")
_NOT_SLUG = re.compile(r"[^a-z0-9]+")
SLUG = re.compile(r"[a-z0-9]+(-+[a-z0-9]+)*")
"""The slug of any test or instance."""


@dataclass(frozen=True)
class Choice:
    """One value of each dimension, in the order in which the dimensions are written; empty without a matrix.

    ``shown`` are values that the label has, but not the slug.
    """

    values: tuple[tuple[str, Scalar], ...] = ()
    shown: tuple[tuple[str, Scalar], ...] = ()

    @property
    def label(self) -> str:
        values = (*self.values, *self.shown)
        return f"[{','.join(f'{k}={v.text}' for k, v in values)}]" if values else ""

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
    number = math.prod(map(len, dimensions.values()))
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
            hint = "names have letters and digits only: write one of them otherwise"
            yield Diagnostic(value.span, "matrix-value", message, hint)
        seen.setdefault(slug, value)
