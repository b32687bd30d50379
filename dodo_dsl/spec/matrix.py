"""``matrix``: an instance of a spec for each choice of values, which replace placeholders as ``${matrix.light}``."""

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Mapping, Node, Scalar, Sequence
from dodo_dsl.spec.placeholders import MATRIX, Placeholders

KEY = MATRIX
MAX_INSTANCES = 2_000
MAX_SLUG = 180

PLACEHOLDERS = Placeholders(
    KEY,
    "the matrix has no dimension '{}'",
    "add it with its values under 'matrix'",
    "so its instances are all the same",
)
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
        """``[light=dark,speed=2]``"""
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
            yield Diagnostic(value.span, "matrix-value", message, _otherwise(value.text))
        seen.setdefault(slug, value)


def _otherwise(text: str) -> str:
    """A hint how to write a value so that its name is another one: signs are not part of names, digits are."""
    whole = re.match(r"[+-]?\d+(?![\d.])", text)
    if not whole:
        return "names have letters and digits only: write one of them otherwise"
    return (
        f"names have letters and digits only: write one of them otherwise, such as '{whole[0]}.0{text[whole.end() :]}'"
    )


def substitute(node: Mapping, choice: Choice) -> Mapping:
    """The node with the choice's values for the placeholders; nodes without placeholders stay the same objects."""
    return PLACEHOLDERS.filled(node, dict(choice.values))
