"""The key ``sandbox`` of ``dodo.yml``, and whether the sizes there can be."""

from collections.abc import Iterator

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Entry, Mapping, Scalar, Sequence
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits
from dodo_dsl.spec.quantity import convert

_LEAST = {"memory": "6 MB", "file-size": "1 kB", "copies": "1 MB", "disk": "1 MB"}
"""The least sizes; Docker takes no limit of memory below 6 MB."""
_MOST = "1000000 GB"


def size_problems(node: object) -> Iterator[Diagnostic]:
    """Sizes in ``sandbox`` or a rig that are too small or beyond any computer; ``node`` is a valid one, or None."""
    if not isinstance(node, Mapping):
        return
    for key, least in _LEAST.items():
        size = node.get(key)
        if isinstance(size, Scalar) and not convert(least, "B") <= convert(size.text, "B") <= convert(_MOST, "B"):
            message = f"'{key}' is {size.text}, expected {least} to {_MOST}"
            yield Diagnostic(size.span, "out-of-range", message)


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
        _bytes(node.get("copies"), default.copies),
        _count(node.get("copied-files"), default.copied_files),
    )


def _bytes(node: object, default: int) -> int:
    return int(convert(node.text, "B")) if isinstance(node, Scalar) else default


def _count(node: object, default: int) -> int:
    return node.value if isinstance(node, Scalar) and isinstance(node.value, int) else default
