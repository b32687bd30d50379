"""Which of the application's messages answer a frame."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.numbers import is_whole, whole

MOST_SURPLUS = 100
"""Surplus messages of one kind to a frame; more of them are a flood that would keep others from the bus."""


@dataclass(frozen=True)
class MessageFilter:
    """A message by its id and sender stamp; None is any stamp. ``name`` is what the application declares."""

    name: str
    data_type: int
    sender_stamp: int | None = None

    def matches(self, envelope: Envelope) -> bool:
        same = envelope.data_type == self.data_type
        return same and self.sender_stamp in (None, envelope.sender_stamp)


@dataclass
class Answers:
    """Collects the application's messages that answer a frame.

    ``required`` have to come once each, unless ``done`` comes; ``relayed`` are others that services of the test
    consume, all of which are passed on; so are those under other sender stamps, which services only count. ``surplus``
    counts answers beyond the one that counts, ``surplus_frames`` the frames with any, ``differing`` those that say
    something else than the one that counts for the same frame, and ``heard`` all messages that matter.
    """

    required: tuple[MessageFilter, ...]
    relayed: tuple[MessageFilter, ...] = ()
    done: MessageFilter | None = None
    surplus: int = 0
    surplus_frames: int = 0
    differing: int = 0
    heard: int = 0
    _strangers: Counter[tuple[int, int]] = field(default_factory=Counter)
    _times: set[int] = field(default_factory=set)
    _all_times: set[int] = field(default_factory=set)
    _chosen: dict[MessageFilter, Envelope] = field(default_factory=dict)
    _chosen_before: dict[MessageFilter, Envelope] = field(default_factory=dict)
    _others: list[Envelope] = field(default_factory=list)
    _surplus_now: Counter[str] = field(default_factory=Counter)
    is_silent: bool = True
    """Whether nothing that matters has come yet."""
    is_copied: bool = True
    """Whether all that matters and came since the frame was expected carries the sample time of a frame."""
    _is_seen: bool = False
    _is_done: bool = False
    _is_collected: bool = False

    def expect(self, times: Iterable[int]) -> None:
        """A frame will be shown, with these sample times (us): answers that copy one of them count at once."""
        self._times = set(times)
        self._all_times |= self._times
        self._chosen_before = self._chosen
        self._chosen, self._is_seen, self._is_done, self._is_collected = {}, False, False, False
        self._surplus_now.clear()
        self.is_copied = True

    def seen(self) -> None:
        """The frame was seen: all that is taken from now on came after it."""
        self._is_seen = True

    def take(self, envelope: Envelope) -> None:
        """Take a message from the bus.

        An answer counts by the frame's sample time. Where the application does not copy sample times, the first message
        after the frame counts, and gets the frame's sample time.
        """
        if not self._times:
            return
        copies = envelope.sample_time in self._all_times
        stale = envelope.sample_time not in self._times if copies else not self._is_seen
        known = envelope if copies else envelope._replace(sample_time=max(self._times))
        if self.done is not None and self.done.matches(envelope) and not stale:
            self._is_done = True
        if any(each.matches(envelope) for each in self.filters):
            self.is_silent = False
            self.heard += 1
            self.is_copied &= copies
        for each in self.required:
            if each.matches(envelope):
                if stale or each in self._chosen or self._is_collected:
                    self._add_surplus(each, envelope, (self._chosen_before if stale else self._chosen).get(each))
                else:
                    self._chosen[each] = known
                return
        is_stranger = not any(each.matches(envelope) for each in self.filters)
        if is_stranger and any(each.data_type == envelope.data_type for each in self.filters):
            self._strangers[envelope.data_type, envelope.sender_stamp] += 1
        consumed = (*self.required, *self.relayed)
        if any(each.data_type == envelope.data_type if is_stranger else each.matches(envelope) for each in consumed):
            self._others.append(known)

    def _add_surplus(self, each: MessageFilter, envelope: Envelope, chosen: Envelope | None) -> None:
        self.surplus += 1
        self.surplus_frames += not self._surplus_now
        self.differing += chosen is not None and chosen.payload != envelope.payload
        self._surplus_now[each.name] += 1

    @property
    def filters(self) -> tuple[MessageFilter, ...]:
        """All messages that matter here."""
        return (*self.required, *self.relayed, *([self.done] if self.done else []))

    @property
    def is_expected(self) -> bool:
        """Whether any message is known to answer a frame."""
        return bool(self.required) or self.done is not None

    @property
    def is_complete(self) -> bool:
        """Whether the frame is answered."""
        if self.done is not None:
            return self._is_done
        return len(self._chosen) == len(self.required)

    @property
    def flood(self) -> str:
        """The message of which more than MOST_SURPLUS came since the frame was expected; empty if none."""
        ((name, count),) = self._surplus_now.most_common(1) or [("", 0)]
        return name if count > MOST_SURPLUS else ""

    @property
    def missing(self) -> list[str]:
        """Names of the messages that the answer lacks."""
        if self.done is not None:
            return [] if self._is_done else [self.done.name]
        return [each.name for each in self.required if each not in self._chosen]

    @property
    def strangers(self) -> dict[int, int]:
        """How often messages came that the answer lacks, but under another sender stamp, by stamp."""
        names = self.missing
        lacking = {each.data_type for each in self.filters if each.name in names}
        counts: Counter[int] = Counter()
        for (id_, stamp), count in self._strangers.items():
            counts[stamp] += count if id_ in lacking else 0
        return dict(+counts)

    def collect(self) -> list[Envelope]:
        """The answer, in an order that does not depend on which sender was faster."""
        others, self._others = self._others, []
        others.sort(key=lambda e: (e.sample_time, e.data_type, e.sender_stamp))
        was_collected, self._is_collected = self._is_collected, True
        chosen = [] if was_collected else [self._chosen[each] for each in self.required if each in self._chosen]
        return [*others, *chosen]


def filters(names: Iterable[str], ids: Mapping[str, int]) -> tuple[MessageFilter, ...]:
    """Messages written as ``name`` or ``name/senderStamp``; raises ValueError for an unknown name."""
    found = []
    for text in names:
        name, _, stamp = text.partition("/")
        if name not in ids or not (is_whole(stamp) or not stamp):
            raise ValueError(
                f"'{text}' is not a message, expected a name such as opendlv.proxy.GroundSteeringRequest/0"
            )
        found.append(MessageFilter(text, ids[name], whole(stamp) if stamp else None))
    return tuple(found)
