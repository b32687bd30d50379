"""A session without a bus, for services that judge a recording."""

from collections.abc import Iterable

from dodo_dsl.opendlv.bus.address import Address
from dodo_dsl.opendlv.bus.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.messages.message_set import MessageSet


class SilentSession(Session):
    """Nobody hears what is sent, and nothing is received. It opens no socket."""

    def __init__(self, cid: int, messages: MessageSet) -> None:
        self.cid, self.messages = cid, messages
        self.garbage = self.lost = 0
        self.is_member = self.hears_directly = self.was_direct = False
        self.address = self.source = ("", 0)

    def send_envelope(self, envelope: Envelope) -> bytes:
        return encode_frame(envelope)

    def send_directly(self, envelope: Envelope, to: Iterable[Address]) -> bytes:
        return encode_frame(envelope)

    def hear_directly(self, hears: bool = True) -> None:
        """There is nothing to hear."""

    def receive(self, timeout: float | None = 0.0) -> Envelope | None:
        return None

    def deafen(self) -> None:
        """There is nothing to hear."""

    def close(self) -> None:
        """Nothing is open."""
