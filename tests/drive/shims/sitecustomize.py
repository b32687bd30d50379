"""A bad network and a wall clock that jumps, in every Python that has this folder on its path."""

import os
import random
import socket
import struct
import threading
import time
from pathlib import Path

LOST_ONE_IN, DELAY_S = 20, 0.05


def spoil_network() -> None:
    """One in 20 datagrams is lost, the others are sent 50 ms later."""
    send = socket.socket.sendto

    def late(self: socket.socket, data: bytes, *to: object) -> int:
        if self.family == socket.AF_INET and self.type == socket.SOCK_DGRAM and random.randrange(LOST_ONE_IN):
            carrier = threading.Timer(DELAY_S, send, (self.dup(), bytes(data), *to))
            carrier.daemon = True
            carrier.start()
        return len(data)

    socket.socket.sendto = late  # type: ignore[method-assign,assignment]


def move_clock(path: str) -> None:
    """By the seconds that a file holds at that moment."""
    true = time.time_ns

    def moved() -> int:
        with Path(path).open("rb") as file:
            return true() + 10**9 * int(struct.unpack("q", file.read())[0])

    time.time_ns, time.time = moved, lambda: moved() / 1e9


if "DODO_TEST_NETWORK" in os.environ:
    spoil_network()
if path := os.environ.get("DODO_TEST_CLOCK"):
    move_clock(path)
