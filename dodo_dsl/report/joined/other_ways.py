"""The ways of another report's tests beside the pages of this one's, to be drawn over one another."""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dodo_dsl import atomic
from dodo_dsl.report.changes.comparison import Comparison, TestChange
from dodo_dsl.report.given_report import GivenReport
from dodo_dsl.report.joined.copies import NotCopied, is_folder
from dodo_dsl.report.joined.drive_page import read_document
from dodo_dsl.report.viewer import page
from dodo_dsl.report.viewer.encoded import packed, script, shown, unpacked
from dodo_dsl.report.viewer.names import BEFORE, DATA, PAGE

VARIABLE = "dodoBefore"
FIELDS = ("x", "y", "qx", "qy", "qz", "qw")


def write(folder: Path, comparison: Comparison | None, other: GivenReport | None) -> None:
    """Puts the ways into ``folder``, a report, and takes away those of an earlier comparison; raises OSError."""
    for path in sorted(folder.glob(f"*/{BEFORE}")):
        path.unlink()
        page.write_html(path.parent)
    if comparison is None or other is None or not other.is_whole:
        return
    for test in comparison.tests:
        if test.before and test.after and (folder / test.after.slug / PAGE).is_file():
            way = _way(other.folder / test.before.slug, test)
            if way is not None:
                place = folder / test.after.slug
                atomic.write_text(place / BEFORE, script(way, VARIABLE))
                page.write_html(place)


def _way(source: Path, test: TestChange) -> dict[str, Any] | None:
    """The positions of a test in another report, which may come from a stranger; None where there are none."""
    if not is_folder(source):
        return None
    with contextlib.suppress(NotCopied, OSError, KeyError, TypeError, ValueError, StopIteration, AttributeError):
        document = read_document(source / DATA)
        frame = document["scene"]["frame"]
        channel = next(
            each
            for each in document["channels"]
            if (each["message"], each["sender"]) == (frame["message"], frame["sender"])
        )
        return _checked(channel, test)
    return None


def _checked(channel: Mapping[str, Any], test: TestChange) -> dict[str, Any]:
    fields = {field["name"]: unpacked(field["values"]) for field in channel["fields"] if field["name"] in FIELDS}
    times = unpacked(channel["times"])
    if {*fields} != {*FIELDS} or {len(values) for values in fields.values()} != {len(times)}:
        raise ValueError("no way")
    return {
        "outcome": shown(test.before.outcome if test.before else "", 20),
        "times": packed(times),
        "fields": [{"name": each, "values": packed(fields[each])} for each in FIELDS],
    }
