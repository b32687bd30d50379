"""The key ``sandbox`` of ``dodo.yml``."""

from dodo_dsl.source import Entry, Mapping, Scalar, Sequence
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits
from dodo_dsl.spec.quantity import convert


def sandbox_limits(entry: Entry | None) -> SandboxLimits:
    """The limits that a valid ``dodo.yml`` sets."""
    node = entry.value if entry else None
    if not isinstance(node, Mapping):
        return SandboxLimits()
    default = SandboxLimits()
    reads = node.get("read")
    return SandboxLimits(
        _bytes(node.get("memory"), default.memory),
        _count(node.get("processes"), default.processes),
        _count(node.get("files"), default.files),
        _bytes(node.get("file-size"), default.file_size),
        tuple(i.text for i in reads.items if isinstance(i, Scalar)) if isinstance(reads, Sequence) else (),
        float(str(cpus.value)) if isinstance(cpus := node.get("cpus"), Scalar) else None,
    )


def _bytes(node: object, default: int) -> int:
    return int(convert(node.text, "B")) if isinstance(node, Scalar) else default


def _count(node: object, default: int) -> int:
    return node.value if isinstance(node, Scalar) and isinstance(node.value, int) else default
