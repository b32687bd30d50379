"""Sends frames on a session's bus that others hand over, all from one address.

As a program, ``relay CID`` prints its host and port, and then sends the frames that it reads. Imports the standard
library alone, as sandboxes load it and start often.
"""

import socket
import sys
from typing import BinaryIO, TextIO

from dodo_dsl.opendlv.address import HEADER_BYTES, Address, FrameError, body_length, group


class Relay:
    """A sender on the bus; ``address`` is where its datagrams come from. Raises OSError if there is no route."""

    def __init__(self, cid: int) -> None:
        self._bus = group(cid)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
            self._socket.bind(("", 0))
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.connect(self._bus)
                host = str(probe.getsockname()[0])
        except OSError:
            self._socket.close()
            raise
        self.address: Address = (host, int(self._socket.getsockname()[1]))

    def send(self, frame: bytes) -> None:
        """Sends one frame; raises OSError."""
        self._socket.sendto(frame, self._bus)

    def close(self) -> None:
        self._socket.close()


def serve(relay: Relay, frames: BinaryIO, stdout: TextIO) -> int:
    """Sends what comes until its end; 1 for what is not a frame, because nothing behind it can be recognised."""
    host, port = relay.address
    print(f"{host} {port}", file=stdout, flush=True)
    while header := frames.read(HEADER_BYTES):
        try:
            frame = header + frames.read(body_length(header))
        except FrameError:
            return 1
        relay.send(frame)
    return 0


if __name__ == "__main__":
    sys.exit(serve(Relay(int(sys.argv[1])), sys.stdin.buffer, sys.stdout))
