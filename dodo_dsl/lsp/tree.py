"""Where in a document a place is: the keys that lead to it."""

from collections.abc import Iterable
from dataclasses import dataclass

from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Mapping, Node, Scalar, walk

Steps = tuple[str | int, ...]


@dataclass(frozen=True)
class DocumentPlace:
    """A key or a scalar of a document, ``steps`` are the keys and indices that lead to it.

    ``value`` is the scalar, or what the key has.
    """

    steps: Steps
    is_key: bool
    span: Span
    value: Node

    @property
    def text(self) -> str:
        return self.value.text if isinstance(self.value, Scalar) else ""


def find(node: Node, line: int, column: int, steps: Steps = ()) -> DocumentPlace | None:
    """The key or scalar at a line and column, which count from 1; None beside all."""
    if isinstance(node, Scalar):
        return DocumentPlace(steps, False, node.span, node) if _covers(node.span, line, column) else None
    if isinstance(node, Mapping):
        for key, entry in node.entries.items():
            if _covers(entry.key, line, column):
                return DocumentPlace((*steps, key), True, entry.key, entry.value)
        children: Iterable[tuple[str | int, Node]] = ((key, entry.value) for key, entry in node.entries.items())
    else:
        children = enumerate(node.items)
    return next((found for step, child in children if (found := find(child, line, column, (*steps, step)))), None)


def below(node: Node | None, *steps: str) -> Node | None:
    """What is below the keys; None where one of them is missing."""
    for step in steps:
        node = node.get(step) if isinstance(node, Mapping) else None
    return node


def text_of(node: Node | None) -> str:
    """A scalar's text; empty for anything else."""
    return node.text if isinstance(node, Scalar) else ""


def last(node: Node) -> Span:
    """The span that ends last of a node and everything below it."""
    return max((part.span for part in walk(node)), key=lambda span: (span.line, span.column + span.length))


def _covers(span: Span, line: int, column: int) -> bool:
    return span.line == line and span.column <= column <= span.column + span.length
