"""The ledger as a file: what each benchmark found, on which machine, and under which load."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.ledger.row import Row, joined
from dodo_dsl import atomic

KIND, VERSION = "ledger", 1


@dataclass(frozen=True)
class Machine:
    processor: str
    cores: int
    memory_gb: float
    system: str
    python: str


@dataclass(frozen=True)
class Bench:
    """A run of one benchmark: its rows, seconds, and the load average before and after it.

    ``trouble`` shows what was wrong. One that was ended because its time was over has not failed.
    """

    name: str
    rows: tuple[Row, ...]
    seconds: float
    budget: float
    load: tuple[float, float]
    trouble: str = ""
    failed: bool = False


@dataclass(frozen=True)
class Ledger:
    commit: str
    at: str
    machine: Machine
    benches: tuple[Bench, ...]

    def rows(self) -> dict[str, Row]:
        """All rows by name; those of several runs of a benchmark as one."""
        found: dict[str, list[Row]] = {}
        for bench in self.benches:
            for row in bench.rows:
                found.setdefault(row.what, []).append(row)
        return {what: joined(parts) for what, parts in found.items()}

    def to_json(self) -> dict[str, Any]:
        return {"dodo": KIND, "version": VERSION, **asdict(self)}

    def write(self, path: Path) -> None:
        atomic.write_text(path, json.dumps(self.to_json(), indent=1) + "\n")


def read(path: Path) -> Ledger:
    """Raises OSError, and ValueError for what is not a ledger."""
    try:
        return _ledger(json.loads(path.read_bytes()))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"{path}: not a ledger of version {VERSION}: {error}") from None


def _ledger(found: dict[str, Any]) -> Ledger:
    if (found["dodo"], found["version"]) != (KIND, VERSION):
        raise ValueError("another kind of file")
    benches = (
        Bench(**{**bench, "rows": tuple(map(Row.from_json, bench["rows"])), "load": tuple(bench["load"])})
        for bench in found["benches"]
    )
    return Ledger(found["commit"], found["at"], Machine(**found["machine"]), tuple(benches))
