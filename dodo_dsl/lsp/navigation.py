"""Navigation in the editor: go to definition, and the outline of a document.

Definitions are those of tests that are extended, maps and other files, services, parameters and rigs. The outline has a
document's keys, with layers, services and their parameters below.
"""

from collections.abc import Iterator
from pathlib import Path

from lsprotocol import types
from pygls.workspace import PositionCodec

from dodo_dsl.check.file_rules import MAP
from dodo_dsl.diagnostics import Span
from dodo_dsl.lsp.documents import DocumentPlace, Lines, below, find, last, saved_text, text_of, uri_of
from dodo_dsl.lsp.project import USES, WITH, DocumentContext
from dodo_dsl.source import Entry, Mapping, Sequence, path_of, read
from dodo_dsl.spec import extends
from dodo_dsl.spec.model import LAYERS

_FILES = ("application", "messages")


def definition(scene: DocumentContext, position: types.Position, codec: PositionCodec) -> types.Location | None:
    place = find(scene.root, *scene.lines.place(position)) if scene.root else None
    span = next(_spans(scene, place), None) if place else None
    if span is None:
        return None
    path = Path(span.file)
    return types.Location(uri_of(path), Lines(saved_text(path), codec).range(span))


def _spans(scene: DocumentContext, place: DocumentPlace) -> Iterator[Span]:
    """Where what stands at a position is defined."""
    steps = place.steps
    if scene.schema == "deployment":
        if steps and steps[0] in _FILES and not place.is_key:
            yield from _begin(path_of(scene.path.parent, place.text))
    elif steps == (extends.KEY,):
        yield from _begin(path_of(scene.path.parent, place.text))
    elif steps[:1] == ("rig",):
        rig = scene.deployment.rig(place.text) if scene.deployment else None
        if rig and Path(rig.node.span.file).is_file():
            yield rig.node.span
    elif parameter := scene.parameter(place):
        if parameter.type == "path" and not place.is_key:
            yield from _begin(path_of(scene.path.parent, place.text))
        elif manifest := scene.manifest(steps):
            yield from _in_manifest(manifest.folder / "service.yml", "parameters", parameter.name)
    elif (manifest := scene.manifest(steps)) and (len(steps) == 2 or steps[2:] == (USES,)):
        yield from _in_manifest(manifest.folder / "service.yml", "name")


def _begin(path: Path | None) -> Iterator[Span]:
    """The start of a file, or of the map in a folder."""
    target = path / MAP if path and path.is_dir() else path
    if target and target.is_file():
        yield Span(str(target), length=0)


def _in_manifest(file: Path, *keys: str) -> Iterator[Span]:
    """The place of a key in a manifest."""
    node, _ = read(file)
    parent = below(node, *keys[:-1])
    if isinstance(parent, Mapping) and keys[-1] in parent.entries:
        yield parent.entries[keys[-1]].key


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
