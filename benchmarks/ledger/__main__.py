"""Runs all benchmarks, or those that are named, and writes their ledger: python -m benchmarks.ledger [NAME...]"""

import argparse
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.ledger import ledger as books
from benchmarks.ledger.compare import WORSE, Change, compare
from benchmarks.ledger.ledger import Bench, Ledger
from benchmarks.ledger.machine import commit_of, this_machine
from benchmarks.ledger.runner import OTHERS, SECONDS, Interrupted, not_run, run, scripts
from benchmarks.ledger.table import change_table, ledger_table
from dodo_dsl import atomic

ROOT = Path(__file__).resolve().parents[2]
TOTAL = sum(SECONDS.values())
ALL_IN_ALL = 590.0
"""Seconds of ``make bench`` with its set-up, less those of the last one if it has to be ended."""
LEAST = 1.0


def parser() -> argparse.ArgumentParser:
    found = argparse.ArgumentParser(prog="python -m benchmarks.ledger", description=__doc__)
    found.add_argument("names", nargs="*", metavar="NAME", help="benchmarks, as 'bus' (default: all)")
    found.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "bench", metavar="DIR")
    found.add_argument(
        "--seconds", type=float, default=TOTAL, help="budget of all together, by shares (default: %(default)s)"
    )
    found.add_argument(
        "--since", type=float, metavar="S",
        help=f"when the command began (Unix time): its set-up counts, and all ends {ALL_IN_ALL:g} s after",
    )  # fmt: skip
    other = found.add_mutually_exclusive_group()
    other.add_argument("--against", type=Path, metavar="FILE", help="compare with a ledger of another commit")
    other.add_argument(
        "--against-checkout",
        type=Path,
        metavar="DIR",
        help="run the benchmarks of another checkout in turns with these",
    )
    return found


def chosen(names: Sequence[str], checkout: Path) -> list[Path]:
    """Scripts in order; raises ValueError for a name that is none."""
    found = {path.stem.removeprefix("bench_"): path for path in scripts(checkout)}
    names = [name.removeprefix("bench_") for name in names]
    unknown = [name for name in names if name not in found]
    if unknown:
        raise ValueError(f"unknown benchmark '{unknown[0]}'; there are {', '.join(found)}")
    return [path for name, path in found.items() if name in names or not names]


Turns = list[tuple[Path, Path, float]]
"""The checkout, a benchmark of its, and the part of its full budget."""
Found = dict[Path, list[Bench]]


def seconds_of(turn: tuple[Path, Path, float]) -> float:
    return SECONDS.get(turn[1].stem, OTHERS) * turn[2]


def follow(turns: Turns, found: Found, deadline: float, keep: Callable[[], None]) -> bool:
    """Runs all, each in its budget or in its share of the time to the ``deadline``; whether none was interrupted.

    After each, what is ``found`` by then is kept.
    """
    for index, (checkout, script, factor) in enumerate(turns):
        rest = sum(map(seconds_of, turns[index:]))
        part = factor * min(1.0, max(0.0, deadline - time.monotonic()) / rest)
        print(f"\n== {script.stem}", flush=True)
        try:
            found[checkout].append(run(script, max(LEAST, SECONDS.get(script.stem, OTHERS) * part)))
        except Interrupted as end:
            found[checkout].append(end.bench)
            for place, other, _ in turns[index + 1 :]:
                found[place].append(not_run(other))
            return False
        keep()
    return True


def ledger_of(checkout: Path, benches: list[Bench]) -> Ledger:
    at = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
    return Ledger(commit_of(checkout), at, this_machine(), tuple(benches))


def turns_of(ours: list[Path], other: Path | None, factor: float) -> Turns:
    """With another checkout the benchmarks of both: each twice, in the order a, b, b, a, in half its budget."""
    if other is None:
        return [(ROOT, script, factor) for script in ours]
    found: Turns = []
    for script in ours:
        theirs = other / "benchmarks" / script.name
        places = [ROOT, other, other, ROOT] if theirs.is_file() else [ROOT, ROOT]
        found += [(place, place / "benchmarks" / script.name, factor / 2) for place in places]
    return found


def write(folder: Path, ledger: Ledger, changes: list[Change] | None = None, before: str = "") -> str:
    """Both files; returns the table."""
    text = ledger_table(ledger)
    if changes is not None:
        text += "\n" + change_table(changes, before, ledger.commit)
    ledger.write(folder / "ledger.json")
    atomic.write_text(folder / "ledger.md", text)
    return text


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def main(words: Sequence[str] | None = None) -> int:
    """1 when a row is worse than in the other ledger, 130 when interrupted; rows that were not measured say why."""
    options = parser().parse_args(words)
    try:
        scripts_here = chosen(options.names, ROOT)
        before = books.read(options.against) if options.against else None
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    seconds = options.seconds
    if options.since:
        seconds = min(seconds, ALL_IN_ALL - (time.time() - options.since))
    other = options.against_checkout.resolve() if options.against_checkout else None
    found: Found = {ROOT: [], **({other: []} if other else {})}
    turns = turns_of(scripts_here, other, options.seconds / TOTAL)
    deadline = time.monotonic() + seconds

    def keep() -> None:
        write(options.output, ledger_of(ROOT, found[ROOT]))

    is_whole = follow(turns, found, deadline, keep)
    if other:
        before = ledger_of(other, found[other])
        before.write(options.output / "before.json")
    after = ledger_of(ROOT, found[ROOT])
    changes = compare(before, after, in_turns=other is not None) if before else None
    text = write(options.output, after, changes, before.commit if before else "")
    print(f"\n{text}\n{options.output / 'ledger.json'}\n{options.output / 'ledger.md'}")
    if not is_whole:
        return 130
    return int(any(change.verdict == WORSE for change in changes or ()))


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
