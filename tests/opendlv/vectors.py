"""Envelopes for tests: the conformance vectors that libcluon itself wrote, and any."""

import re
from dataclasses import dataclass
from pathlib import Path

from hypothesis import strategies as st

from dodo_dsl.opendlv.envelope import Envelope


@dataclass(frozen=True)
class Vector:
    title: str
    id: int
    sender_stamp: int
    time: int
    payload: bytes
    frame: bytes


_VECTOR = re.compile(
    r"^(?P<title>.+?) id=(?P<id>\d+) senderStamp=(?P<stamp>\d+) ts=(?P<s>-?\d+)\.(?P<us>-?\d+)\n"
    r"  payload (?P<payload>[0-9a-f]*)\n  envelope (?P<frame>[0-9a-f]+)$",
    re.MULTILINE,
)


def read(path: Path) -> list[Vector]:
    return [
        Vector(
            title=match["title"],
            id=int(match["id"]),
            sender_stamp=int(match["stamp"]),
            time=int(match["s"]) * 1_000_000 + int(match["us"]),
            payload=bytes.fromhex(match["payload"]),
            frame=bytes.fromhex(match["frame"]),
        )
        for match in _VECTOR.finditer(path.read_text())
    ]


TIMES = st.integers(-(2**31) * 1_000_000, 2**31 * 1_000_000 - 1)
ENVELOPES = st.builds(
    Envelope, st.integers(-(2**31), 2**31 - 1), st.binary(max_size=300), TIMES, TIMES, TIMES, st.integers(0, 2**32 - 1)
)
