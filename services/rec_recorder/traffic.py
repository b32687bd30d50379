"""The limits of what a test may send, and which messages it is made of."""

import json
from collections.abc import Callable

from dodo_dsl.opendlv.bus.envelope import Envelope

MOST_PER_SECOND, MOST_OF_A_KIND = 20_000, 10_000
"""Messages within a second; of one message and sender stamp."""
_MOST_KINDS = 1000
_SECOND = 1_000_000


class FloodError(RuntimeError):
    """More is sent than a recording takes; one sentence."""


Kind = tuple[int, int]
"""A message's id and sender stamp; the id is 0 for those that are too many to be told apart."""


class Traffic:
    """Counts envelopes by kind, and ends the recording of a flood.

    ``now`` gives microseconds of real time; it is None in lockstep, where the clock limits messages by frames. ``lost``
    gives how many messages the kernel has dropped so far, and ``name`` the message of an id.
    """

    def __init__(
        self, most_bytes: int, now: Callable[[], int] | None, lost: Callable[[], int], name: Callable[[int], str]
    ) -> None:
        self._most_bytes, self._now, self._lost, self._name = most_bytes, now, lost, name
        self._bytes: dict[Kind, int] = {}
        self._second: dict[Kind, int] = {}
        self._begin, self._lost_before = 0, 0
        self._size = self._number = 0

    def add(self, envelope: Envelope, size: int) -> None:
        """Takes an envelope of ``size`` bytes before it is written; raises FloodError, and reports it to the runner."""
        kind = (envelope.data_type, envelope.sender_stamp)
        if kind not in self._bytes and len(self._bytes) >= _MOST_KINDS:
            kind = (0, 0)
        self._bytes[kind] = self._bytes.get(kind, 0) + size
        self._size += size
        if self._size > self._most_bytes:
            self._end("size", f"the recording would be larger than {self._most_bytes / 1e6:g} MB", self._bytes)
        if self._now is not None:
            self._count(kind, self._now())

    def _count(self, kind: Kind, now: int) -> None:
        if not 0 <= now - self._begin < _SECOND:
            self._second.clear()
            self._number = 0
            self._begin, self._lost_before = now, self._lost()
        self._number += 1
        count = self._second[kind] = self._second.get(kind, 0) + 1
        if count > MOST_OF_A_KIND:
            self._end("rate", f"more than {MOST_OF_A_KIND} messages of a kind came within a second", self._second)
        if self._number + self._lost() - self._lost_before > MOST_PER_SECOND:
            self._end("rate", f"more than {MOST_PER_SECOND} messages came within a second", self._second)

    def _end(self, limit: str, what: str, counts: dict[Kind, int]) -> None:
        (id_, stamp), most = max(counts.items(), key=lambda item: item[1])
        message = self._name(id_) if id_ else "many kinds of messages"
        facts = {"limit": limit, "what": what, "message": message, "sender": stamp}
        print(json.dumps({"dodo": "flood", **facts, "share": round(most / sum(counts.values()), 3)}), flush=True)
        raise FloodError(f"{what}, most of it {message}/{stamp}")
