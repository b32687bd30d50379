"""Rigs: the hardware that a deployment has, and the emulated one that every machine has."""

import functools
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.source import Entry, Mapping, Node, Scalar, parse

EMULATED = "emulated"
EMULATED_FILE = "the emulated rig"
RPICAM = "rpicam"
"""The source of a camera of a Raspberry Pi."""
CAMERA_SOURCE = "camera.source"
PORT = "serial"
"""The key of a rig's port. A service whose manifest takes a parameter from it moves the rig."""

_EMULATED = """
kind: dynamic
serial: emulated
camera: {source: emulated, width: 640, height: 480}
"""


@dataclass(frozen=True)
class Rig:
    """A rig; ``kind`` is static or dynamic, ``cid`` the one reserved for it, None for the emulated one."""

    name: str
    kind: str
    cid: int | None
    node: Mapping

    @property
    def is_emulated(self) -> bool:
        return self.name == EMULATED

    @property
    def tag(self) -> str:
        """The tag of its GitLab runner; the emulated rig runs wherever simulations do."""
        return "sil" if self.is_emulated else f"hil-{self.kind}"

    @property
    def isolation(self) -> str:
        """``host`` for hardware, which is reached through the host, ``network`` for the emulated rig."""
        return "network" if self.is_emulated else "host"

    @property
    def privileged(self) -> bool:
        """Whether services of an application may be privileged on this rig."""
        node = self.node.get("privileged")
        return isinstance(node, Scalar) and node.value is True

    def text(self, key: str) -> str:
        """The string at a dotted key; empty where there is none."""
        entry = self.entry(key)
        return entry.value.text if entry and isinstance(entry.value, Scalar) else ""

    def entry(self, key: str) -> Entry | None:
        """The rig's entry at a dotted key such as ``camera.width``."""
        node: Node = self.node
        entry = None
        for part in key.split("."):
            entry = node.entries.get(part) if isinstance(node, Mapping) else None
            if entry is None:
                return None
            node = entry.value
        return entry


def is_simulated(port: str) -> bool:
    """Whether no hardware is at a port: the emulated rig's, or a pseudo-terminal, whose other end is a program."""
    return port == EMULATED or Path(port).resolve().parent == Path("/dev/pts")


@functools.cache
def emulated() -> Rig:
    """The rig whose firmware runs in a simulator."""
    node, _ = parse(_EMULATED, EMULATED_FILE)
    assert isinstance(node, Mapping)
    return Rig(EMULATED, "dynamic", None, node)
