"""The page of a test from another report: its data once more, checked to be data, with this DoDo's page and scripts.

A report's ``drive.js`` is a script, and may come from a stranger: only the value that it assigns is kept.
"""

import json
from pathlib import Path
from typing import Any

from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import Outcome
from dodo_dsl.report.joined.copies import NotCopied, Room, opened
from dodo_dsl.report.viewer import page
from dodo_dsl.report.viewer.encoded import VARIABLE, script, shown
from dodo_dsl.report.viewer.names import DATA, VIDEOS

_BEGIN, _END = f"var {VARIABLE} = ", ";\n"


def copy_page(source: Path, target: Path, outcome: Outcome, room: Room) -> bool:
    """Writes the page of a test, by its new name, where ``source`` has one; raises NotCopied and OSError."""
    if not (source / DATA).exists() and not (source / DATA).is_symlink():
        return False
    document = read_document(source / DATA)
    document["test"] = {**document["test"], "name": shown(outcome.name), "slug": shown(outcome.slug)}
    try:
        text = script(document)
    except (ValueError, RecursionError):  # numbers such as 1e999
        raise NotCopied("it is not the data of a drive") from None
    if len(text) > room.left:
        raise NotCopied("the report would become too large")
    room.left -= len(text)
    target.mkdir(parents=True, exist_ok=True)
    (target / DATA).write_text(text, encoding="ascii")
    page.write_html(target)
    return True


def read_document(path: Path) -> dict[str, Any]:
    """The value that a ``drive.js`` assigns; raises NotCopied for anything else, and OSError."""
    with opened(path) as file:
        data = file.read(regular_file.MOST_BYTES + 1)
    if len(data) > regular_file.MOST_BYTES:
        raise NotCopied(f"it is larger than {regular_file.MOST_BYTES} bytes")
    try:
        text = data.decode("ascii")
        if not (text.startswith(_BEGIN) and text.endswith(_END)):
            raise NotCopied("it holds more than the data of a drive")
        document = page.of_today(json.loads(text[len(_BEGIN) : -len(_END)], parse_constant=_refuse))
        if document["version"] != page.VERSION:
            raise NotCopied(f"it is of version {shown(document['version'], 20)}, expected {page.VERSION}")
        if not isinstance(document["test"], dict) or not {*_videos(document)} <= {*VIDEOS}:
            raise NotCopied("it is not the data of a drive")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise error if isinstance(error, NotCopied) else NotCopied("it is not the data of a drive") from error
    return dict(document)


def _videos(document: Any) -> list[str]:
    return [video["file"] for video in document["videos"] if "file" in video]


def _refuse(constant: str) -> None:
    raise ValueError(constant)
