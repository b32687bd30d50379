"""Recordings as CSV, field by field as ``cluon-rec2csv`` writes them.

A file ``<Message>-<senderStamp>.csv`` for each message and sender, rows in the order of their sample times; cells end
with ``;``, times are seconds and microseconds, floats have 7 digits and doubles 11, strings and bytes are base64.
"""

import base64
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dodo_dsl.opendlv import message_columns
from dodo_dsl.opendlv.frame_table import Fact
from dodo_dsl.opendlv.message_columns import Column, Numbers
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.protobuf_classes import Layout
from dodo_dsl.opendlv.recording import Batch, Recording

TIMES = tuple(
    f"{time}.{unit}" for time in ("sent", "received", "sampleTimeStamp") for unit in ("seconds", "microseconds")
)
_FORMATS = {"float": "%.7g;", "double": "%.11g;", "string": '"%s";', "bytes": '"%s";', "char": "%c;"}


def write(recording: Recording, messages: MessageSet, rows: Numbers, folder: Path) -> Counter[int]:
    """Write the files of the known messages among ``rows`` into a folder that has none of them yet.

    Returns how many payloads of which message cannot be decoded: they have no row. Raises OSError and RecordingError.
    """
    undecodable: Counter[int] = Counter()
    for batch in recording.batches(recording.by_time(rows)):
        for data_type, sender_stamp, group in _groups(batch):
            layout = messages.layout(data_type)
            path = folder / f"{layout.definition.name}-{sender_stamp}.csv"
            lines, bad = _lines(layout, group)
            undecodable[data_type] += bad
            with path.open("a", encoding="latin-1", newline="\n") as file:
                if file.tell() == 0 and lines:
                    file.write(_header(layout))
                file.write("".join(lines))
    return +undecodable


def names(recording: Recording, messages: MessageSet, rows: Numbers) -> list[str]:
    """The files that ``write`` makes of rows with known messages."""
    index = recording.index[rows]
    keys = np.unique(index["data_type"].astype(np.int64) << 32 | index["sender_stamp"]).tolist()
    return [f"{messages.name(key >> 32)}-{key & 0xFFFFFFFF}.csv" for key in keys]


def _header(layout: Layout) -> str:
    return "".join(f"{name};" for name in (*TIMES, *(name for name, _ in message_columns.column_names(layout)))) + "\n"


def _groups(batch: Batch) -> Iterator[tuple[int, int, Batch]]:
    """The rows of each message and sender stamp, in their order."""
    keys = batch.table[Fact.DATA_TYPE] << 32 | batch.table[Fact.SENDER_STAMP]
    order = np.argsort(keys, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(keys[order])) + 1):
        data_type, sender_stamp = batch.table[[Fact.DATA_TYPE, Fact.SENDER_STAMP], rows[0]].tolist()
        yield data_type, sender_stamp, batch.select(rows)


def _lines(layout: Layout, batch: Batch) -> tuple[list[str], int]:
    """The rows of one message as text, and how many could not be decoded."""
    table = batch.table
    decoded, good = message_columns.decode(layout, batch.data, table[Fact.PAYLOAD], table[Fact.PAYLOAD_END])
    formats, cells = ["%d;"] * len(TIMES), [column.tolist() for column in table[Fact.SENT_S : Fact.SENDER_STAMP]]
    for column in decoded:
        format_, values = _cells(column)
        formats.append(format_)
        cells.append(values)
    line = "".join(formats) + "\n"
    if good.all():
        return [line % row for row in zip(*cells, strict=True)], 0
    return [line % row for row, ok in zip(zip(*cells, strict=True), good, strict=True) if ok], int((~good).sum())


def _cells(column: Column) -> tuple[str, list[Any]]:
    format_ = _FORMATS.get(column.type, "%d;")
    if isinstance(column.values, list):
        return format_, [base64.b64encode(value).decode() for value in column.values]
    values = column.values.tolist()
    if column.type in ("float", "double") and np.isnan(column.values).any():
        negative = (np.isnan(column.values) & np.signbit(column.values)).tolist()  # C++ writes their sign
        number = format_.removesuffix(";")
        return "%s;", ["-nan" if sign else number % value for value, sign in zip(values, negative, strict=True)]
    return format_, values
