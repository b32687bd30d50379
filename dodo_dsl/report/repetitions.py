"""Repetitions of a test in lockstep, which should be the same: what each gave, and what differs.

In real time values scatter; there only the rate at which a test passes says something.
"""

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from dodo_dsl.outcome import Outcome, differs_each_run
from dodo_dsl.plan.added_services import RECORDING

PATH = ("opendlv.sim.Frame", "opendlv.sim.KinematicState")
"""The messages of the vehicle's path."""
_MOST_SHOWN, _MAX_SHOWN = 10, 60
"""Runs of a line, and characters of a value."""


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


def repeated(runs: Iterable[tuple[Path, Outcome, Path]]) -> dict[str, list[str]]:
    """What differs between runs of one test in lockstep, a line each, by the slug of the first.

    A run is its compiled test, its outcome and its report. Tests that ran once or in real time are left out.
    """
    found: defaultdict[Path, list[tuple[Outcome, Path]]] = defaultdict(list)
    for compiled, outcome, report in runs:
        if outcome.clock != "realtime":
            found[compiled].append((outcome, report))
    several = (each for each in found.values() if len(each) > 1)
    return {each[0][0].slug: _differing([values(*run) for run in each]) for each in several}


def _differing(runs: Sequence[Mapping[str, str]]) -> list[str]:
    """The names whose values are not all the same, each with the values of the first runs in their order."""
    names = dict.fromkeys(name for run in runs for name in run)
    rows = {name: [run.get(name, "none") for run in runs] for name in names}
    return [
        f"{name}: {', '.join(value[:_MAX_SHOWN] for value in row[:_MOST_SHOWN])}"
        for name, row in rows.items()
        if len(set(row)) > 1
    ]
