"""Where messages go, and the header of their frames.

Each session has a UDP multicast group and port, as for libcluon; some messages go past it. A header is ``0D A4`` and
the length of the envelope behind it. Imports the standard library alone, as sandboxes load it and start often.
"""

Address = tuple[str, int]
"""Host and port."""

PORT = 12175
RECEIVE_BUFFER = 26_214_400
"""Bytes that a session's socket may hold; libcluon requests as many."""
OF_THE_WORLD = ("opendlv.sim.", "dodo.", "cluon.data.")
"""So begin the names of messages that only a simulation has, and those who control it: no bus of a car carries them."""
POSE = ("opendlv.sim.Frame", "opendlv.sim.KinematicState")
"""Those that carry where the vehicle truly is, or how it moves."""

LINES = "dodo-lines"
"""The sender, among a test's services, of what its application prints: the runner."""

CHANNEL_VARIABLE = "DODO_CHANNEL"
"""Environment variable of DoDo's services: the folder where they meet, which the application does not have."""


def group(cid: int) -> Address:
    """The multicast group of a session, with its port."""
    return f"225.0.0.{cid}", PORT


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
