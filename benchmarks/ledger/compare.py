"""Two ledgers row by row: a difference counts only where the quartiles of the rounds lie apart."""

from dataclasses import dataclass

from benchmarks.ledger.ledger import Ledger
from benchmarks.ledger.row import Row
from benchmarks.ledger.spread import FEWEST, Spread

WORSE, BETTER, SAME = "worse", "better", "within the spread"
TOO_FEW = f"fewer than {FEWEST} rounds"
UNPAIRED = "no peer, and not run in turns"


@dataclass(frozen=True)
class Change:
    what: str
    before: Spread
    after: Spread
    verdict: str


def compare(before: Ledger, after: Ledger, in_turns: bool) -> list[Change]:
    """Rows that both ledgers measured.

    Ratios are compared, as their peers ran on the same machine at the same time. The values of rows without a peer say
    something only where the benchmarks of both commits ran in turns.
    """
    old, new = before.rows(), after.rows()
    return [change for what in old if what in new and (change := _change(old[what], new[what], in_turns))]


def _change(old: Row, new: Row, in_turns: bool) -> Change | None:
    if old.ratios and new.ratios:
        before, after = Spread.of(old.ratios), Spread.of(new.ratios)
        return Change(new.what, before, after, _verdict(before, after, less=False))
    if not old.ours or not new.ours:
        return None
    before, after = Spread.of(old.ours), Spread.of(new.ours)
    return Change(new.what, before, after, _verdict(before, after, new.less) if in_turns else UNPAIRED)


def _verdict(before: Spread, after: Spread, less: bool) -> str:
    if min(before.rounds, after.rounds) < FEWEST:
        return TOO_FEW
    order = after.order(before) * (-1 if less else 1)
    return SAME if not order else BETTER if order > 0 else WORSE
