"""Where messages go, and the header of their frames.

Each session has a UDP multicast group and port, as for libcluon; some messages go past it. A header is ``0D A4`` and
the length of the envelope behind it. Imports the standard library alone, as sandboxes load it and start often.
"""

import socket

Address = tuple[str, int]
"""Host and port."""

PORT = 12175
RECEIVE_BUFFER = 26_214_400
"""Bytes that a session's socket may hold; libcluon requests as many."""
OF_THE_WORLD = ("opendlv.sim.", "dodo.", "cluon.data.")
"""So begin the names of messages that only a simulation has, and those who control it: no bus of a car carries them."""
IMAGE = 1055
"""The id of opendlv.proxy.ImageReading, in which recordings have the frames of cameras."""
POSE = ("opendlv.sim.Frame", "opendlv.sim.KinematicState")
"""Those that carry where the vehicle truly is, or how it moves."""

LINES = "dodo-lines"
"""The sender, among a test's services, of what its application prints: the runner."""

CHANNEL_VARIABLE = "DODO_CHANNEL"
"""Environment variable of DoDo's services: the folder where they meet, which the application does not have."""


def group(cid: int) -> Address:
    """The multicast group of a session, with its port."""
    return f"225.0.0.{cid}", PORT


def sender(bus: Address) -> tuple[socket.socket, Address]:
    """Time to live 1, loop on; with the address that its datagrams carry. Raises OSError, as if there is no route.

    It has its port at all addresses of this machine: were it connected, another program could have the same port at
    another address, and put the first one into its datagrams (``IP_PKTINFO``).
    """
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
        made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        made.bind(("", 0))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(bus)
            return made, (str(probe.getsockname()[0]), int(made.getsockname()[1]))
    except OSError:
        made.close()
        raise


def is_of_the_world(name: str) -> bool:
    """Whether a message goes to a test's services alone, by its name, which a sender stamp may follow."""
    return name.startswith(OF_THE_WORLD)


MAGIC = b"\x0d\xa4"
HEADER_BYTES = 5


class FrameError(ValueError):
    """Bytes that are not a frame, or an envelope that fits in none."""


def body_length(header: bytes) -> int:
    """The length in bytes of the envelope that follows a header of 5 bytes; raises FrameError."""
    if len(header) < HEADER_BYTES or header[:2] != MAGIC:
        raise FrameError("not a frame: the header is missing")
    return int.from_bytes(header[2:5], "little")
