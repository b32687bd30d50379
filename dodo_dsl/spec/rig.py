"""Rigs: the hardware that a deployment has, and emulated ones."""

import functools
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.source import Entry, Mapping, Node, Scalar, Sequence, entries, parse
from dodo_dsl.spec import quantity

EMULATED = "emulated"
EMULATED_CIRCLE = "emulated-circle"
EMULATED_RIGS = (EMULATED, EMULATED_CIRCLE)
"""The rigs that every machine has, and the names of no others."""
EMULATED_FILE = "the emulated rig"
CIRCLE = "circle"
"""The kind of a rig whose yaw turns without end. Such a rig alone has its kind under this key, too, for a flag."""
MEMORY = "memory"
"""The key of a flag for all limits of a rig, as its own memory keeps them: ``x=1.5,speed=0.4``, in m, rad and s."""
LIMIT_UNITS = {
    "x": "m",
    "y": "m",
    "yaw": "rad",
    "speed": "m/s",
    "yaw-rate": "rad/s",
    "acceleration": "m/s2",
    "yaw-acceleration": "rad/s2",
}
CAMERA_SOURCE = "camera.source"
KIND_TAGS = {"static": ("hil-static",), "dynamic": ("hil-dynamic",), CIRCLE: ("hil-dynamic", "hil-circle")}
"""The tags of GitLab runners by the kinds of their rigs; the second keeps laps from a rig that winds up its cable."""
SIMULATION_TAG = "sil"
"""The tag of runners without a rig."""
RESERVED_TAGS = frozenset({SIMULATION_TAG}.union(*KIND_TAGS.values()))
PORT = "serial"
"""The key of a rig's port. A service whose manifest takes a parameter from it moves the rig."""
_SIZE = ("camera.width", "camera.height")
"""What an emulated rig has as ``dodo.yml`` says; all else is its firmware's and its virtual camera's."""


@dataclass(frozen=True)
class Rig:
    """A rig; ``kind`` is static, dynamic or circle, ``cid`` the one reserved for it, None for an emulated one."""

    name: str
    kind: str
    cid: int | None
    node: Mapping

    @property
    def is_emulated(self) -> bool:
        return self.cid is None

    @property
    def is_missing(self) -> bool:
        """Whether it stands for one of its kind, of which the deployment has none."""
        return self.name in KIND_TAGS and self.node.span.file == EMULATED_FILE

    @property
    def is_whole(self) -> bool:
        """Whether ``dodo.yml`` says where its camera is, and the port of one that moves."""
        return all(self.entry(key) for key in (CAMERA_SOURCE, PORT)[: 1 if self.kind == "static" else 2])

    @property
    def tag(self) -> str:
        """The tag of its GitLab runner; a rig that ``dodo.yml`` emulates runs wherever simulations do."""
        declared = self.is_emulated and self.node.span.file != EMULATED_FILE
        return SIMULATION_TAG if declared else KIND_TAGS[self.kind][0]

    @property
    def more_tags(self) -> tuple[str, ...]:
        node = None if self.is_emulated else self.node.get("tags")
        texts = [item.text for item in node.items if isinstance(item, Scalar)] if isinstance(node, Sequence) else []
        own = () if self.tag == SIMULATION_TAG else KIND_TAGS[self.kind][1:]
        return tuple(dict.fromkeys((*own, *(text for text in texts if text != self.tag))))

    @property
    def isolation(self) -> str:
        """``host`` for hardware, which is reached through the host, ``network`` for the emulated rig."""
        return "network" if self.is_emulated else "host"

    @property
    def privileged(self) -> bool:
        node = self.node.get("privileged")
        return isinstance(node, Scalar) and node.value is True and not self.is_emulated

    def text(self, key: str) -> str:
        entry = self.entry(key)
        return entry.value.text if entry and isinstance(entry.value, Scalar) else ""

    def entry(self, key: str) -> Entry | None:
        if key == CIRCLE:
            return self.node.entries.get("kind") if self.kind == CIRCLE else None
        if key == MEMORY:
            return self._memory
        own = _at(self.node, key) if key in _SIZE or not self.is_emulated else None
        return own or (_at(_built_in(self.kind), key) if self.is_emulated else None)

    @functools.cached_property
    def _memory(self) -> Entry | None:
        entry = self.node.entries.get("limits")
        if entry is None or not isinstance(entry.value, Mapping) or self.is_emulated:
            return None
        words = []
        for name, unit in LIMIT_UNITS.items():
            if isinstance(limit := entry.value.get(name), Scalar):
                words.append(f"{name}={quantity.decimal_text(quantity.convert(limit.text, unit))}")
        text = ",".join(words)
        return Entry(entry.key, Scalar(entry.value.span, text, text)) if words else None


def is_simulated(port: str) -> bool:
    """Whether no hardware is at a port: the emulated rig's, or a pseudo-terminal, whose other end is a program."""
    return port == EMULATED or Path(port).resolve().parent == Path("/dev/pts")


def _at(node: Node, key: str) -> Entry | None:
    *above, last = key.split(".")
    return entries(node, *above).get(last)


def emulated(name: str = EMULATED) -> Rig:
    """A rig whose firmware runs in a simulator: one of EMULATED_RIGS, or one of a kind, which is missing."""
    kind = name if name in KIND_TAGS else CIRCLE if name == EMULATED_CIRCLE else "dynamic"
    return Rig(name, kind, None, _built_in(kind))


@functools.cache
def _built_in(kind: str) -> Mapping:
    port = "" if kind == "static" else "serial: emulated\n"
    text = f"kind: {kind}\n{port}camera: {{source: emulated, width: 640, height: 480}}\n"
    node, _ = parse(text, EMULATED_FILE)
    assert isinstance(node, Mapping)
    return node
