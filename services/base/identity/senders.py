"""Who may send which message of a test: the table that the compiler makes of the wiring."""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Self

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.bus.proof import is_proven
from dodo_dsl.opendlv.messages.message_set import MessageSet

VARIABLE = "DODO_SENDERS"
"""Environment variable with words such as ``opendlv.sim.Frame/0=pose``; no service behind ``=``: nobody may send it.

``my-pose?`` is a service that may not say from where it sends. Without a sender stamp all of them are meant.
"""
RUNNER_ONLY = ("dodo.TestBegin", "dodo.Alive")
"""Messages of the runner, which prove themselves."""
_MOST_NAMED = 3


@dataclass(frozen=True)
class Producers:
    """The ``services`` that alone may send a message; ``silent`` are those that may not say from where."""

    message: str
    services: tuple[str, ...] = ()
    silent: frozenset[str] = frozenset()

    @property
    def reason(self) -> str:
        """Why a test fails in which the application sent the message."""
        *others, last = [f"'{name}'" for name in self.services] or [""]
        who = f"only {', '.join(others)} and {last} may send" if others else f"only {last} may send"
        if not self.services:
            who = "no service of this test sends"
        elif len(self.services) > _MOST_NAMED:
            who = "only services of the test may send"
        return f"the application sent {self.message}, which {who}"


@dataclass
class SenderTable:
    """The producers by message; reports, once for each message, that the application has sent one of theirs."""

    messages: MessageSet
    key: bytes = b""
    by_message: dict[tuple[int, int | None], Producers] = field(default_factory=dict)
    _reported: set[str] = field(default_factory=set)
    _of_runner: dict[int, str] = field(init=False)

    def __post_init__(self) -> None:
        self._of_runner = {self.messages.id(name): name for name in RUNNER_ONLY}

    @classmethod
    def load(cls, messages: MessageSet, key: bytes) -> Self:
        """The table that the environment names, empty without one; raises ValueError for words that make none."""
        return cls(messages, key, dict(_entries(os.environ.get(VARIABLE, ""), messages)))

    @property
    def ids(self) -> frozenset[int]:
        """Ids of all messages that not everybody may send."""
        return frozenset([*self._of_runner, *(id_ for id_, _ in self.by_message)])

    @property
    def services(self) -> frozenset[str]:
        """All services in the table."""
        return frozenset(name for each in self.by_message.values() for name in each.services)

    def producers(self, envelope: Envelope) -> Producers | None:
        """Those of a message; None for one that anybody may send."""
        of_stamp = self.by_message.get((envelope.data_type, envelope.sender_stamp))
        return of_stamp or self.by_message.get((envelope.data_type, None))

    def is_of_runner(self, envelope: Envelope) -> bool:
        """Whether a message of the runner proves itself, which the others need not; reports one that does not."""
        name = self._of_runner.get(envelope.data_type)
        if name is None or is_proven(self.key, envelope.data_type, envelope.payload):
            return True
        self.report(f"the application sent {name}, which only the runner may send")
        return False

    def report(self, reason: str) -> None:
        """Tell the runner why the test fails."""
        if reason not in self._reported:
            self._reported.add(reason)
            print(json.dumps({"dodo": "foreign", "reason": reason}), flush=True)


def _entries(text: str, messages: MessageSet) -> Iterator[tuple[tuple[int, int | None], Producers]]:
    for word in text.split():
        message, _, names = word.partition("=")
        name, _, stamp = message.partition("/")
        if stamp and not stamp.isdecimal():
            raise ValueError(f"{VARIABLE}: '{message}' has no whole number as its sender stamp")
        written = [each for each in names.split(",") if each]
        silent = frozenset(each.removesuffix("?") for each in written if each.endswith("?"))
        services = tuple(each.removesuffix("?") for each in written)
        yield (messages.id(name), int(stamp) if stamp else None), Producers(message, services, silent)
