"""Repetitions of a test in lockstep, which should be the same: what each gave, and what differs.

In real time values scatter; there only the rate at which a test passes says something.
"""

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.outcome import Outcome, differs_each_run
from dodo_dsl.plan.added_services import RECORDING

PATH = ("opendlv.sim.Frame", "opendlv.sim.KinematicState")
"""The messages of the vehicle's path."""
_MOST_SHOWN, _MAX_SHOWN = 4, 100


@dataclass(frozen=True)
class Difference:
    """What is not the same in all runs."""

    name: str
    """A check, or outcome, reason, test time or path, a hash of where the vehicle was."""
    values: tuple[str, ...]
    """The value of each run, in their order."""

    def in_words(self) -> str:
        """Each value with its runs, counted from 1; the last of many are left out."""
        runs: defaultdict[str, list[str]] = defaultdict(list)
        for number, value in enumerate(self.values, 1):
            runs[value].append(str(number))
        parts = [
            f"{value[:_MAX_SHOWN]} in run{'s' * (len(numbers) > 1)} {', '.join(numbers)}"
            for value, numbers in runs.items()
        ]
        more = [f"and {len(parts) - _MOST_SHOWN} more"] if len(parts) > _MOST_SHOWN else []
        return f"{self.name}: {'; '.join([*parts[:_MOST_SHOWN], *more])}"


@dataclass(frozen=True)
class Repeated:
    """The runs of a test in lockstep."""

    test: str
    """The slug of the test."""
    runs: tuple[str, ...]
    """The slugs of its runs."""
    differing: tuple[Difference, ...] = ()
    """What is not the same in all runs; empty where all are the same."""

    def lines(self) -> Iterator[str]:
        """What to print of it."""
        if not self.differing:
            yield f"{self.test}: the {len(self.runs)} runs in lockstep have the same values"
            return
        yield f"{self.test}: the {len(self.runs)} runs in lockstep differ"
        for each in self.differing:
            yield f"        {each.in_words()}"


def values(outcome: Outcome, report: Path) -> dict[str, str]:
    """What is the same in each run in lockstep, by name; ``report`` is the folder of the test's report.

    What measures the program and the machine is left out, and a reason that this may have decided.
    """
    found: dict[str, str] = {"outcome": outcome.outcome}
    if not any(differs_each_run(check["name"]) and not check["ok"] for check in outcome.checks):
        found["reason"] = outcome.reason
    found["test time"] = "none" if outcome.sim_s is None else f"{outcome.sim_s!r} s"
    for number, check in enumerate(outcome.checks):
        if not differs_each_run(check["name"]):
            name = check["name"] if check["name"] not in found else f"{check['name']} ({number})"
            found[name] = f"{check['value']!r} {check['unit']}".rstrip()
    found["path"] = path_of(report / RECORDING)
    return found


def path_of(recording: Path) -> str:
    """A hash of all messages of the vehicle's path in a recording; "none" if it cannot be read."""
    from dodo_dsl.opendlv.message_set import MessageSet
    from dodo_dsl.opendlv.recording import read_envelopes

    digest, wanted = hashlib.sha256(), {MessageSet.standard().id(name) for name in PATH}
    try:
        for each in read_envelopes(recording):
            if each.data_type in wanted:
                digest.update(repr((each.data_type, each.sender_stamp, each.sample_time, each.payload)).encode())
    except OSError:
        return "none"
    return digest.hexdigest()[:16]


def compared(runs: Sequence[tuple[str, dict[str, str]]]) -> Repeated:
    """Repetitions of a test, each by its slug with its ``values``; the first has the test's own."""
    names = dict.fromkeys(name for _, found in runs for name in found)
    rows = [Difference(name, tuple(found.get(name, "none") for _, found in runs)) for name in names]
    differing = tuple(row for row in rows if len(set(row.values)) > 1)
    return Repeated(runs[0][0], tuple(slug for slug, _ in runs), differing)


def repeated(runs: Iterable[tuple[Path, Outcome, Path]]) -> list[Repeated]:
    """Those of each test in lockstep that ran more than once; a run is its compiled test, outcome and report."""
    found: defaultdict[Path, list[tuple[Outcome, Path]]] = defaultdict(list)
    for compiled, outcome, report in runs:
        if outcome.clock != "realtime":
            found[compiled].append((outcome, report))
    several = (each for each in found.values() if len(each) > 1)
    return [compared([(outcome.slug, values(outcome, report)) for outcome, report in each]) for each in several]
