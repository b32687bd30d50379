"""Rows and ledgers for the tests of the ledger."""

from benchmarks.ledger.ledger import Bench, Ledger, Machine
from benchmarks.ledger.row import Row, rate_row

MACHINE = Machine("a processor", 2, 8.0, "Linux 6", "3.11.9")


def rated(*ratios: float, what: str = "bus", **rest: object) -> Row:
    """Ours and a peer that does 10 a second in every round."""
    return rate_row(what, "messages/s", [10 * ratio for ratio in ratios], "a peer", [10.0] * len(ratios), **rest)


def ledger(*rows: Row, trouble: str = "", commit: str = "abc") -> Ledger:
    bench = Bench("bench_bus", rows, 12.5, 40.0, (0.5, 1.5), trouble)
    return Ledger(commit, "2026-01-02 03:04 UTC", MACHINE, (bench,))
