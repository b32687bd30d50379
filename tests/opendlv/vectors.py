"""Reader of the conformance vectors that libcluon itself wrote."""

import re
from dataclasses import dataclass
from pathlib import Path


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
