"""Edits in the editor: quick fixes, each by itself, as ``dodo compile --check --fix`` would write them, and renaming.

Renamed is a service of a test, or a name of its matrix or ranges, wherever the file has it.
"""

import re
from collections.abc import Iterable, Iterator

from lsprotocol import types
from pygls.exceptions import JsonRpcInvalidParams

from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.lsp.documents import DocumentPlace, Lines, below, find, uri_of
from dodo_dsl.lsp.project import DocumentContext
from dodo_dsl.source import Mapping, Scalar, walk
from dodo_dsl.spec import matrix, vary
from dodo_dsl.spec.model import LAYERS


def quick_fixes(
    found: Iterable[Diagnostic], uri: str, lines: Lines, wanted: types.CodeActionParams
) -> Iterator[types.CodeAction]:
    """Those of the problems of a document that touch the wanted range, as far as its text still has them."""
    only = wanted.context.only
    if only and not any(kind in ("", types.CodeActionKind.QuickFix) for kind in only):
        return
    shown = {(_key(each.range), each.code): each for each in wanted.context.diagnostics}
    for diagnostic in sorted(set(found)):
        place = lines.range(diagnostic.span)
        if diagnostic.fix is None or not _touch(place, wanted.range):
            continue
        text = lines.text[lines.index(place.start) : lines.index(place.end)]
        mended = diagnostic.fix.mended(text)
        if mended == text:
            continue
        about = shown.get((_key(place), diagnostic.rule))
        yield types.CodeAction(
            f"Write '{mended.strip()}'",
            types.CodeActionKind.QuickFix,
            [about] if about else None,
            is_preferred=True,
            edit=types.WorkspaceEdit(changes={uri: [types.TextEdit(place, mended)]}),
        )


def _key(place: types.Range) -> tuple[int, int, int, int]:
    return place.start.line, place.start.character, place.end.line, place.end.character


def _touch(one: types.Range, other: types.Range) -> bool:
    first, second = _key(one), _key(other)
    return first[:2] <= second[2:] and second[:2] <= first[2:]


_KEYS = (matrix.KEY, vary.KEY)
_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_LONGEST = 40


def prepare(scene: DocumentContext, position: types.Position) -> types.Range | None:
    """The range of the name at a position; None if nothing can be renamed."""
    name = _name(scene, position)
    return _within(scene, name.span, name.steps[1]) if name else None


def rename(scene: DocumentContext, position: types.Position, new: str) -> types.WorkspaceEdit:
    """All edits of the file; raises JsonRpcInvalidParams with a sentence on why the name cannot become ``new``."""
    name = _name(scene, position)
    if name is None:
        raise JsonRpcInvalidParams("only services of this file, and names of its matrix and ranges, can be renamed")
    if not _NAME.fullmatch(new) or len(new) > _LONGEST:
        raise JsonRpcInvalidParams(
            f"'{new}' is not a name, expected lower-case letters and digits in words joined by single hyphens"
        )
    kind, old = str(name.steps[0]), str(name.steps[1])
    beside = below(scene.root, kind)
    if new != old and isinstance(beside, Mapping) and new in beside.entries:
        raise JsonRpcInvalidParams(f"'{kind}' has '{new}' already")
    places = [_within(scene, name.span, old), *_placeholders(scene, kind, old)]
    edits = [types.TextEdit(place, new) for place in places if place]
    return types.WorkspaceEdit(changes={uri_of(scene.path): edits})


def _name(scene: DocumentContext, position: types.Position) -> DocumentPlace | None:
    """The key at a position, if it names a service that this file adds, or a part of its matrix or ranges."""
    place = find(scene.root, *scene.lines.place(position)) if scene.root else None
    if place is None or scene.schema != "dodo" or not place.is_key or len(place.steps) != 2:
        return None
    is_service = place.steps[0] in LAYERS and isinstance(place.value, Mapping) and "uses" in place.value.entries
    return place if is_service or place.steps[0] in _KEYS else None


def _placeholders(scene: DocumentContext, kind: str, old: str) -> Iterator[types.Range]:
    """The places of the name in ``${matrix.name}`` and its like."""
    if kind not in _KEYS or scene.root is None:
        return
    pattern = re.compile(rf"\$\{{{kind}\.({re.escape(old)})\}}")
    for scalar in walk(scene.root):
        if isinstance(scalar, Scalar):
            start = scene.lines.offset(scalar.span.line, scalar.span.column)
            for found in pattern.finditer(scene.lines.text, start, start + scalar.span.length):
                yield types.Range(scene.lines.position(found.start(1)), scene.lines.position(found.end(1)))


def _within(scene: DocumentContext, span: Span, name: object) -> types.Range | None:
    """The range of a name in its span, without quotes; None if it is written otherwise."""
    start = scene.lines.offset(span.line, span.column)
    found = scene.lines.text.find(str(name), start, start + span.length)
    if found < 0:
        return None
    return types.Range(scene.lines.position(found), scene.lines.position(found + len(str(name))))
