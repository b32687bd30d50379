"""A pool of rigs, as a test writes it: ``{any: dynamic}`` or ``{any: [kiwi-1, kiwi-2]}``."""

from dataclasses import dataclass

from dodo_dsl.source import Mapping, Node, Scalar, Sequence

ANY = "any"


@dataclass(frozen=True)
class Pool:
    """A kind of rigs, all of which will do, or the names of those that will."""

    kind: Scalar | None = None
    names: tuple[Scalar, ...] = ()

    @property
    def text(self) -> str:
        return self.kind.text if self.kind else f"[{', '.join(word.text for word in self.names)}]"


def pool_of(node: Node | None) -> Pool | None:
    """The pool that the value of ``rig`` is; None for a rig's name, and for what the schema refuses."""
    written = node.get(ANY) if isinstance(node, Mapping) else None
    if isinstance(written, Scalar) and isinstance(written.value, str):
        return Pool(kind=written)
    if isinstance(written, Sequence):
        return Pool(names=tuple(item for item in written.items if isinstance(item, Scalar)))
    return None
