"""Which sender stamps a service heard: a message under another stamp than its own is easily taken for silence."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

from dodo_dsl.opendlv.bus.envelope import Envelope


@dataclass
class HeardStamps:
    """Counts messages by sender stamp; ``inputs`` are ids and stamps that the service takes, with their names."""

    inputs: Mapping[tuple[int, int | None], str]
    _heard: Counter[tuple[int, int]] = field(default_factory=Counter)

    def take(self, envelope: Envelope) -> None:
        """A message of a type that the service takes, whatever its stamp."""
        self._heard[envelope.data_type, envelope.sender_stamp] += 1

    def strangers(self) -> list[str]:
        """A sentence for each input that never came, while others of its type did."""
        return [
            f"no {name}/{stamp} came, but {others(counts)}"
            for (id_, stamp), name in self.inputs.items()
            if stamp is not None and not self._heard[id_, stamp] and (counts := self._others(id_))
        ]

    def _others(self, id_: int) -> dict[int, int]:
        """How often each stamp came that no input of a message has."""
        known: Collection[int | None] = {stamp for other, stamp in self.inputs if other == id_}
        if None in known:
            return {}
        return {stamp: count for (other, stamp), count in self._heard.items() if other == id_ and stamp not in known}


def others(counts: Mapping[int, int]) -> str:
    """``120 with sender stamp 99``, and so on, by stamp."""
    return " and ".join(f"{count} with sender stamp {stamp}" for stamp, count in sorted(counts.items()))


def with_strangers(reason: str, strangers: Iterable[str]) -> str:
    """A reason with what was heard under other stamps."""
    return "; ".join([reason, *strangers])
