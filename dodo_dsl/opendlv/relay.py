"""Sends datagrams for the runner, all from one address, to a session's bus and to services.

As a program, ``relay CID`` prints a line, and then sends what it reads: lines of names and data in hexadecimal. Imports
the standard library alone, as sandboxes load it and start often.
"""

import contextlib
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TextIO

from dodo_dsl.opendlv import address_book
from dodo_dsl.opendlv.address import CHANNEL_VARIABLE, Address, group, sender

BUS = "*"
"""Stands for all on the bus, as does a service that has not entered its address."""


class Relay:
    """A sender on the bus, which enters its address in the test's folder; raises OSError, as if there is no route."""

    def __init__(self, cid: int, folder: Path, name: str = address_book.RUNNER) -> None:
        self._bus, self._book = group(cid), address_book.AddressBook(folder)
        self._socket, address = sender(self._bus)
        try:
            address_book.enter(folder, name, address)
        except OSError:
            self._socket.close()
            raise

    def send(self, data: bytes, to: Iterable[str] = (BUS,)) -> None:
        """Sends to services by their names; who cannot be reached misses it."""
        self._book.read()
        addresses: set[Address] = {self._book.addresses.get(name, self._bus) for name in to}
        for address in addresses:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, address)

    def close(self) -> None:
        self._socket.close()


def serve(relay: Relay, lines: TextIO, stdout: TextIO) -> int:
    print("ready", file=stdout, flush=True)
    for each in lines:
        *to, data = each.split()
        relay.send(bytes.fromhex(data), to)
    return 0


if __name__ == "__main__":
    sys.exit(serve(Relay(int(sys.argv[1]), Path(os.environ[CHANNEL_VARIABLE])), sys.stdin, sys.stdout))
