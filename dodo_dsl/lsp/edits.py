"""Quick fixes in the editor, each by itself, as ``dodo compile --check --fix`` would write them."""

from collections.abc import Iterable, Iterator

from lsprotocol import types

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.lsp.documents import Lines


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
        text = lines.text(diagnostic.span)
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
