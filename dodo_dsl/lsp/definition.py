"""Go to definition: tests that are extended, maps and other files, services, parameters, rigs."""

from collections.abc import Iterator
from pathlib import Path

from lsprotocol import types
from pygls.workspace import PositionCodec

from dodo_dsl.check.rules.inputs.references import MAP
from dodo_dsl.diagnostics import Span
from dodo_dsl.lsp.documents import saved_text, uri_of
from dodo_dsl.lsp.positions import Lines
from dodo_dsl.lsp.scene import USES, DocumentContext
from dodo_dsl.lsp.tree import DocumentPlace, below, find
from dodo_dsl.source import Mapping, path_of, read
from dodo_dsl.spec import extends

_FILES = ("application", "messages")


def definition(scene: DocumentContext, position: types.Position, codec: PositionCodec) -> types.Location | None:
    place = find(scene.root, *scene.lines.place(position)) if scene.root else None
    span = next(_spans(scene, place), None) if place else None
    if span is None:
        return None
    path = Path(span.file)
    return types.Location(uri_of(path), Lines(saved_text(path), codec).range(span))


def _spans(scene: DocumentContext, place: DocumentPlace) -> Iterator[Span]:
    """Where what stands at a place is defined."""
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
    """The begin of a file, or of the map in a folder."""
    target = path / MAP if path and path.is_dir() else path
    if target and target.is_file():
        yield Span(str(target), length=0)


def _in_manifest(file: Path, *keys: str) -> Iterator[Span]:
    """The place of a key in a manifest."""
    node, _ = read(file)
    parent = below(node, *keys[:-1])
    if isinstance(parent, Mapping) and keys[-1] in parent.entries:
        yield parent.entries[keys[-1]].key
