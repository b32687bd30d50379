"""Which of the application's messages answer a frame."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from dodo_dsl.opendlv.bus.envelope import Envelope


@dataclass(frozen=True)
class Kind:
    """A message by its id and sender stamp; None is any stamp. ``name`` is as the application declares it."""

    name: str
    data_type: int
    sender_stamp: int | None = None

    def is_of(self, envelope: Envelope) -> bool:
        same = envelope.data_type == self.data_type
        return same and self.sender_stamp in (None, envelope.sender_stamp)


@dataclass
class Answers:
    """Collects what the application says to a frame.

    ``wanted`` are the messages that have to come once each, unless ``done`` comes; ``heard`` are others that services
    of the test listen to, of which all that come are handed on. ``surplus`` counts answers beyond the one that counts.
    """

    wanted: tuple[Kind, ...]
    heard: tuple[Kind, ...] = ()
    done: Kind | None = None
    surplus: int = 0
    _times: set[int] = field(default_factory=set)
    _all_times: set[int] = field(default_factory=set)
    _chosen: dict[Kind, Envelope] = field(default_factory=dict)
    _others: list[Envelope] = field(default_factory=list)
    _is_seen: bool = False
    _is_done: bool = False
    _is_collected: bool = False

    def expect(self, times: Iterable[int]) -> None:
        """The frame will be seen from now on: its pictures' sample times (us), by which answers count at once."""
        self._times = set(times)
        self._all_times |= self._times
        self._chosen, self._is_seen, self._is_done, self._is_collected = {}, False, False, False

    def seen(self) -> None:
        """All that is taken from now on was said after the frame was seen."""
        self._is_seen = True

    def take(self, envelope: Envelope) -> None:
        """Something came on the bus.

        An answer counts by the frame's sample time, or as the first after it where the application does not copy
        sample times, so that its own are those of no frame; it then gets the frame's.
        """
        if not self._times:
            return
        copies = envelope.sample_time in self._all_times
        stale = envelope.sample_time not in self._times if copies else not self._is_seen
        known = envelope if copies else envelope._replace(sample_time=max(self._times))
        if self.done is not None and self.done.is_of(envelope) and not stale:
            self._is_done = True
        for kind in self.wanted:
            if kind.is_of(envelope):
                if stale or kind in self._chosen or self._is_collected:
                    self.surplus += 1
                else:
                    self._chosen[kind] = known
                return
        if any(kind.is_of(envelope) for kind in self.heard):
            self._others.append(known)

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Everything that counts in one way or the other."""
        return (*self.wanted, *self.heard, *([self.done] if self.done else []))

    @property
    def asked(self) -> bool:
        """Whether anything is known that answers a frame."""
        return bool(self.wanted) or self.done is not None

    @property
    def complete(self) -> bool:
        """Whether the frame is answered."""
        if self.done is not None:
            return self._is_done
        return len(self._chosen) == len(self.wanted)

    @property
    def missing(self) -> list[str]:
        """What the answer lacks, by name."""
        if self.done is not None:
            return [] if self._is_done else [self.done.name]
        return [kind.name for kind in self.wanted if kind not in self._chosen]

    def collect(self) -> list[Envelope]:
        """The answer, in an order that does not depend on which sender was faster."""
        others, self._others = self._others, []
        others.sort(key=lambda e: (e.sample_time, e.data_type, e.sender_stamp))
        given, self._is_collected = self._is_collected, True
        chosen = [] if given else [self._chosen[kind] for kind in self.wanted if kind in self._chosen]
        return [*others, *chosen]


def kinds(names: Iterable[str], ids: Mapping[str, int]) -> tuple[Kind, ...]:
    """Messages written as ``name`` or ``name/senderStamp``; raises ValueError for an unknown name."""
    found = []
    for text in names:
        name, _, stamp = text.partition("/")
        if name not in ids or not (stamp.isdecimal() or not stamp):
            raise ValueError(f"'{text}' is no message, expected a name such as opendlv.proxy.GroundSteeringRequest/0")
        found.append(Kind(text, ids[name], int(stamp) if stamp else None))
    return tuple(found)
