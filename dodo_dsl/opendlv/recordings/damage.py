"""What a reader of a recording passed over, and where."""

from dataclasses import dataclass, field

MAX_PLACES = 1000


@dataclass
class DamagePlace:
    """Bytes of a file that are no frame: ``size`` of them from byte ``offset``."""

    offset: int
    size: int
    reason: str

    def __str__(self) -> str:
        unit = "byte" if self.size == 1 else "bytes"
        return f"{self.size} {unit} at byte {self.offset}: {self.reason}"


@dataclass
class Damage:
    """All skipped bytes: ``count`` places with ``size`` bytes in total; ``places`` has the first thousand."""

    places: list[DamagePlace] = field(default_factory=list)
    count: int = 0
    size: int = 0
    _end: int = -1

    def __bool__(self) -> bool:
        return self.count > 0

    def add(self, offset: int, size: int, reason: str) -> None:
        """Note bytes in the order of the file; neighbours are one place with the first reason."""
        self.size += size
        if offset == self._end:
            if self.count <= MAX_PLACES:
                self.places[-1].size += size
        else:
            self.count += 1
            if self.count <= MAX_PLACES:
                self.places.append(DamagePlace(offset, size, reason))
        self._end = offset + size

    def __str__(self) -> str:
        if not self:
            return "nothing was skipped"
        rest = f", and {self.count - 1} more places, {self.size} bytes together" if self.count > 1 else ""
        return f"skipped {self.places[0]}{rest}"
