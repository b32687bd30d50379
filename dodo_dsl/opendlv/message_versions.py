"""Which message set a recording was made with: 0.9 and 1.0 give some ids other meanings."""

from functools import cache
from pathlib import Path

from dodo_dsl.opendlv import message_columns, odvd
from dodo_dsl.opendlv.frame_table import Fact
from dodo_dsl.opendlv.message_set import MessageSet, besides, merged
from dodo_dsl.opendlv.odvd import STANDARD_0_9, shipped
from dodo_dsl.opendlv.recording import Recording

OLD, NEW = "0.9", "1.0"

TELLING = (1001, 1003, 1017, 1118, 1119, *range(1128, 1137), 1180, 1181)
"""Ids that mean something else in the other set or nothing at all, as a payload shows."""
_LOOKS = 500  # messages of each id that are looked at


@cache
def load(version: str, *own: Path) -> MessageSet:
    """The messages of set 0.9 or 1.0 and those of the files, which replace them; raises OdvdError.

    Either set also has what only the other has, as far as names and ids are free. A file's copy of what is in one of
    them replaces nothing.
    """
    old, new = odvd.load(STANDARD_0_9), shipped()
    first, second = (old, new) if version == OLD else (new, old)
    theirs = [each for each in merged(own) if not any(map(each.same_layout, (*old, *new)))]
    return MessageSet([*besides(theirs, [*first, *besides(first, second)]), *theirs])


def version_of(recording: Recording) -> str:
    """The set that more of the telling messages fit in their fields; 1.0 if none does.

    ImageReading does not count: real applications of set 1.0 leave its last field out.
    """
    old, new = (sum(_fitting(recording, load(version), id_) for id_ in TELLING) for version in (OLD, NEW))
    return OLD if old > new else NEW


def _fitting(recording: Recording, messages: MessageSet, id_: int) -> int:
    if id_ not in messages.ids():
        return 0
    count = 0
    for batch in recording.batches(recording.rows(messages=[id_])[:_LOOKS]):
        starts, ends = batch.table[Fact.PAYLOAD], batch.table[Fact.PAYLOAD_END]
        count += int(message_columns.usual_rows(messages.layout(id_), batch.data, starts, ends).sum())
    return count
