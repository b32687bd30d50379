"""What keeps tests of the process backend apart."""

from dataclasses import dataclass

SLOT_VARIABLE = "DODO_SLOT"
"""Environment variable of a test's processes on the host: the name of its slot, by which leftovers are found."""


@dataclass(frozen=True)
class Slot:
    """A CID, a name, a prefix of shared memory, and the descriptors of the leases; name and prefix only on the host."""

    cid: int
    name: str = ""
    memory_prefix: str = ""
    descriptors: tuple[int, ...] = ()
