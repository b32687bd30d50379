"""What a test allows each service of the application to use of the machine: ``resources``."""

from dataclasses import dataclass
from typing import NamedTuple

from dodo_dsl.spec.quantity import SHARE


@dataclass(frozen=True)
class ResourceLimits:
    """Millions of bytes of memory, its growth in such in a minute, seconds on processors, and these by the test's time.

    None where there is no limit.
    """

    max_memory_mb: float | None = None
    max_memory_growth: float | None = None
    max_processor_time_s: float | None = None
    max_processor_share: float | None = None


class ResourceKey(NamedTuple):
    """A key of ``resources``, the field that it sets, its unit and bounds, and these in words."""

    name: str
    field: str
    unit: str
    bounds: tuple[float, float]
    expected: str


KEYS = (
    ResourceKey("max-memory", "max_memory_mb", "MB", (1, 1e6), "1 MB to 1000 GB"),
    ResourceKey("max-memory-growth", "max_memory_growth", "MB/min", (0, 1e6), "0 MB/min to 1000000 MB/min"),
    ResourceKey("max-processor-time", "max_processor_time_s", "s", (0.01, 1e6), "10 ms to 1000000 s"),
    ResourceKey("max-processor-share", "max_processor_share", SHARE, (0.0001, 1000), "0.01 % to 100000 %"),
)


def is_valid(limits: ResourceLimits) -> bool:
    """Whether what was read back is of the right types and within its bounds."""
    values = ((getattr(limits, key.field), key.bounds) for key in KEYS)
    return all(
        value is None or (isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high)
        for value, (low, high) in values
    )
