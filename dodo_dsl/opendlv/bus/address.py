"""Where the bus is: the UDP multicast group and port of each session, as libcluon's OD4Session has them.

Imports the standard library alone, as sandboxes load it and start often.
"""

Address = tuple[str, int]
"""Host and port."""

PORT = 12175
RECEIVE_BUFFER = 26_214_400
"""Bytes that a session's socket may hold; libcluon requests as many."""


def group(cid: int) -> Address:
    """The multicast group of a session, with its port."""
    return f"225.0.0.{cid}", PORT
