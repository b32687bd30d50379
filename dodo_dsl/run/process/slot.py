"""What keeps tests of the process backend apart."""

import secrets
from dataclasses import dataclass, field

from dodo_dsl.opendlv.bus.proof import KEY_BYTES

SLOT_VARIABLE = "DODO_SLOT"
"""Environment variable of a test's processes on the host: the name of its slot, by which leftovers are found."""


def new_key() -> bytes:
    """The key of a test, which its services have and the application has not."""
    return secrets.token_bytes(KEY_BYTES)


@dataclass(frozen=True)
class Slot:
    """A CID, a name, a prefix of shared memory, the descriptors of the leases, and the key of the test.

    Name and prefix are given only on the host.
    """

    cid: int
    name: str = ""
    memory_prefix: str = ""
    descriptors: tuple[int, ...] = ()
    key: bytes = field(default_factory=new_key, repr=False)
