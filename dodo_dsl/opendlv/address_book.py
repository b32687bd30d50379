"""From where each service of a test sends, and where it listens: a link for each in the folder that no application has.

A link leads nowhere: it is made and read at once, and holds an address. It is there while the service is ready. Imports
the standard library alone, as sandboxes load it and start often.
"""

import contextlib
import time
from pathlib import Path

from dodo_dsl.opendlv.address import Address

RUNNER, HEARTBEAT = "dodo-runner", "dodo-heartbeat"
"""The runner, where it announces the start and sends what an application prints; and where it sends signs of life."""
_TICK_NS = 50_000_000
"""Of the clock by which a file system notes changes: two within a tick look like one."""


def enter(folder: Path, name: str, address: Address, left: str = "") -> None:
    """Says where a service is, and since when (us since the epoch) it has ``left``; raises OSError."""
    new = folder / f".{name}"
    new.unlink(missing_ok=True)
    new.symlink_to(f"{address[0]}:{address[1]}:{left}")
    new.replace(folder / name)


def leave(folder: Path, name: str, address: Address) -> None:
    """What comes from there from now on is not the service's: another program may have got its port."""
    enter(folder, name, address, str(time.time_ns() // 1000))


def remove(folder: Path, name: str) -> None:
    (folder / name).unlink(missing_ok=True)


class AddressBook:
    """The addresses in a folder by the names of services, those that have left among them.

    ``present`` are those of services that have not. Without a folder the book is empty.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._changed = 0
        self._left: dict[Address, int] = {}
        self.addresses: dict[str, Address] = {}
        self.present: set[Address] = set()

    def read(self) -> None:
        if self._folder is None or (changed := self._folder.stat().st_mtime_ns) == self._changed:
            return
        self._changed = changed if time.time_ns() - changed > _TICK_NS else 0
        self.addresses.clear()
        self._left.clear()
        self.present.clear()
        for path in self._folder.iterdir():
            if path.name.startswith("."):  # the clock's socket, or an entry that is being made
                continue
            with contextlib.suppress(OSError, ValueError):  # it has just been removed, or says no address
                host, port, left = str(path.readlink()).split(":")
                self.addresses[path.name] = address = host, int(port)
                if left:
                    self._left[address] = int(left)
                else:
                    self.present.add(address)

    def knows(self, address: Address, time: int) -> bool:
        """Whether a service of the test sent what came from an address at a time (us since the epoch)."""
        self.read()
        return address in self.present or time <= self._left.get(address, -1)
