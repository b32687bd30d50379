"""What the application may use, and what it sees where it runs as processes: the key ``sandbox`` of ``dodo.yml``."""

from dataclasses import dataclass

from dodo_dsl.source import Entry, Mapping, Scalar, Sequence
from dodo_dsl.spec.quantity import convert


@dataclass(frozen=True)
class SandboxLimits:
    """``memory`` in bytes of a service with all its processes; ``file_size`` in bytes; ``files`` open in a process.

    ``processes`` counts threads, too. ``cpus`` are the processors of a container, None for all.
    ``reads`` are paths beside the application's own folder that it may read.
    """

    memory: int = 2 * 10**9
    processes: int = 1024
    files: int = 1024
    file_size: int = 10**9
    reads: tuple[str, ...] = ()
    cpus: float | None = None


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
    return int(str(node.value)) if isinstance(node, Scalar) else default
