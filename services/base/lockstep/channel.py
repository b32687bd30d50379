"""A socket beside the bus, between the clock of a lockstep test and one service, which wakes no others."""

import logging
import socket
import time

from google.protobuf.message import Message

from dodo_dsl.opendlv.bus.address import RECEIVE_BUFFER, Address, group
from dodo_dsl.opendlv.bus.envelope import Envelope, FrameError, decode_frame, encode_frame
from dodo_dsl.opendlv.bus.proof import is_proven, with_proof
from dodo_dsl.opendlv.bus.session import MAX_DATAGRAM_BYTES, MAX_DROPPED
from dodo_dsl.opendlv.messages.message_set import MessageSet

_log = logging.getLogger(__name__)


class ClockChannel:
    """Sends messages in OpenDLV's frames to one address, or to all on the bus, and receives the replies.

    All of them prove that their sender has the key of the test; what does not is no reply.
    """

    def __init__(self, cid: int, messages: MessageSet, key: bytes = b"") -> None:
        self._group = group(cid)
        self._messages = messages
        self._key = key
        self.foreign = 0
        """How many datagrams came without a proof."""
        self._has_failed = False
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
        self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._socket.bind(("", 0))
        self._socket.setblocking(False)

    def send(self, message: Message, to: Address | None) -> None:
        """Send to an address, or with None to all on the bus; what cannot be sent now is lost, and will be repeated.

        A lasting error is logged once.
        """
        frame = encode_frame(self.envelope(message))
        try:
            self._socket.sendto(frame, to or self._group)
        except BlockingIOError:
            return
        except OSError as error:
            if not self._has_failed:
                self._has_failed = True
                _log.warning("a message to %s:%d cannot be sent: %s", *(to or self._group), error)

    def envelope(self, message: Message) -> Envelope:
        """A message of now, with its proof."""
        now, id_ = time.time_ns() // 1000, self._messages.id(message)
        return Envelope(id_, with_proof(self._key, id_, self._messages.encode(message)), now, 0, now, 0)

    def believes(self, envelope: Envelope) -> bool:
        """Whether a message comes from one who has the key."""
        return is_proven(self._key, envelope.data_type, envelope.payload)

    def receive(self) -> tuple[Envelope, Address] | None:
        """The next envelope with its sender's address; None when there is none. Invalid datagrams are skipped."""
        for _ in range(MAX_DROPPED):
            try:
                data, address = self._socket.recvfrom(MAX_DATAGRAM_BYTES)
                envelope = decode_frame(data)
            except FrameError:
                self.foreign += 1
                continue
            except OSError:  # nothing there, or a peer has gone
                return None
            if self.believes(envelope):
                return envelope, address
            self.foreign += 1
        return None

    def fileno(self) -> int:
        """The file descriptor to poll for reading."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
