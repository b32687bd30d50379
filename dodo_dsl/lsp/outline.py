"""The outline of a document: its keys, with layers, services and their parameters below."""

from collections.abc import Iterator

from lsprotocol import types

from dodo_dsl.lsp.positions import Lines
from dodo_dsl.lsp.scene import USES, WITH, DocumentContext
from dodo_dsl.lsp.tree import below, last, text_of
from dodo_dsl.source import Entry, Mapping, Sequence
from dodo_dsl.spec.model import LAYERS

_MAX_DETAIL = 80


def outline(scene: DocumentContext) -> list[types.DocumentSymbol]:
    return list(_symbols(scene.lines, scene.root, ())) if isinstance(scene.root, Mapping) else []


def _symbols(lines: Lines, parent: Mapping, steps: tuple[str, ...]) -> Iterator[types.DocumentSymbol]:
    for key, entry in parent.entries.items():
        is_service = len(steps) == 1 and steps[0] in LAYERS
        below_it = below(entry.value, WITH) if is_service else entry.value
        children = _symbols(lines, below_it, (*steps, key)) if isinstance(below_it, Mapping) else ()
        detail = text_of(below(entry.value, USES)) if is_service else _detail(entry)
        whole, name = _whole(lines, entry), lines.range(entry.key)
        yield types.DocumentSymbol(key or "''", _kind(steps, key), whole, name, detail, children=list(children))


def _whole(lines: Lines, entry: Entry) -> types.Range:
    start, ending = lines.range(entry.key), lines.range(last(entry.value))
    return types.Range(start.start, ending.end if _before(start.end, ending.end) else start.end)


def _before(a: types.Position, b: types.Position) -> bool:
    return (a.line, a.character) < (b.line, b.character)


def _kind(steps: tuple[str, ...], key: str) -> types.SymbolKind:
    if not steps and key in LAYERS:
        return types.SymbolKind.Module
    return types.SymbolKind.Class if steps and steps[0] in LAYERS and len(steps) == 1 else types.SymbolKind.Property


def _detail(entry: Entry) -> str:
    if isinstance(entry.value, Sequence):
        text = ", ".join(text_of(item) for item in entry.value.items)
    else:
        text = text_of(entry.value)
    return text if len(text) <= _MAX_DETAIL else f"{text[:_MAX_DETAIL]}..."
