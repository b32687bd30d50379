"""Runs all benchmarks, or those that are named, and writes their ledger: python -m benchmarks.ledger [NAME...]"""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.ledger import ledger as books
from benchmarks.ledger.compare import WORSE, Change, compare
from benchmarks.ledger.ledger import Bench, Ledger
from benchmarks.ledger.machine import commit_of, this_machine
from benchmarks.ledger.runner import OTHERS, SECONDS, run, scripts
from benchmarks.ledger.table import change_table, ledger_table
from dodo_dsl import atomic

ROOT = Path(__file__).resolve().parents[2]
TOTAL = sum(SECONDS.values())


def parser() -> argparse.ArgumentParser:
    found = argparse.ArgumentParser(prog="python -m benchmarks.ledger", description=__doc__)
    found.add_argument("names", nargs="*", metavar="NAME", help="benchmarks, as 'bus' (default: all)")
    found.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "bench", metavar="DIR")
    found.add_argument(
        "--seconds", type=float, default=TOTAL, help="budget of all together, by shares (default: %(default)s)"
    )
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


def measure(script: Path, factor: float) -> Bench:
    print(f"\n== {script.stem}", flush=True)
    return run(script, SECONDS.get(script.stem, OTHERS) * factor)


def ledger_of(checkout: Path, benches: list[Bench]) -> Ledger:
    at = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
    return Ledger(commit_of(checkout), at, this_machine(), tuple(benches))


def in_turns(ours: list[Path], other: Path, factor: float) -> tuple[list[Bench], list[Bench]]:
    """The benchmarks of this checkout and of the other: each twice, in the order a, b, b, a, in half its budget."""
    found: dict[Path, list[Bench]] = {ROOT: [], other: []}
    for script in ours:
        theirs = other / "benchmarks" / script.name
        places = [ROOT, other, other, ROOT] if theirs.is_file() else [ROOT, ROOT]
        for place in places:
            found[place].append(measure(place / "benchmarks" / script.name, factor / 2))
    return found[ROOT], found[other]


def write(folder: Path, ledger: Ledger, changes: list[Change] | None, before: str) -> None:
    text = ledger_table(ledger)
    if changes is not None:
        text += "\n" + change_table(changes, before, ledger.commit)
    ledger.write(folder / "ledger.json")
    atomic.write_text(folder / "ledger.md", text)
    print(f"\n{text}\n{folder / 'ledger.json'}\n{folder / 'ledger.md'}")


def main(words: Sequence[str] | None = None) -> int:
    """1 when a benchmark failed or a row is worse than in the other ledger."""
    options = parser().parse_args(words)
    try:
        scripts_here = chosen(options.names, ROOT)
        before = books.read(options.against) if options.against else None
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    factor = options.seconds / TOTAL
    if options.against_checkout:
        other = options.against_checkout.resolve()
        benches, others = in_turns(scripts_here, other, factor)
        before = ledger_of(other, others)
        before.write(options.output / "before.json")
    else:
        benches = [measure(script, factor) for script in scripts_here]
    after = ledger_of(ROOT, benches)
    changes = compare(before, after, in_turns=bool(options.against_checkout)) if before else None
    write(options.output, after, changes, before.commit if before else "")
    failed = any(bench.failed for bench in benches)
    return int(failed or any(change.verdict == WORSE for change in changes or ()))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
