"""The page with the kill matrix, and what is wrong with the matrix."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import yaml

from dodo_dsl.atomic import write_text
from tests import faults
from tests.faulty.makes import GOOD
from tests.faulty.matrix import Cell, Cells, ShippedTest
from tests.faulty.table import FAULTS, RANGES, ROS, Fault

GAPS: Mapping[str, Mapping[str, str]] = yaml.safe_load(Path(__file__).with_name("gaps.yml").read_text(encoding="utf-8"))
MARKS = {"failed": "**F**", "passed": "·", "error": "E"}
NOT_RUN = "?"
LONGEST = 300  # characters of a reason
HEAD = """# Evidence

Do the shipped tests catch faulty applications, and do they say what is wrong? `scripts/kill-matrix` turns the
[example application](../examples/kiwi/README.md) into {faults} faulty ones, as student teams write them, runs each
of them against all {tests} shipped tests of the levels sil and dil in lockstep, and writes this page. The faults stand
in `tests/faulty`. One by hand:

    FAULT=steering-reversed dodo run sil-open-straight --application tests/faulty/docker-compose.yml

{caught} of {faults} are caught by one test or more. {good} {run} of {all} combinations of fault and test have run.
A result is kept until the
test's spec changes, so that it may be of an earlier version of DoDo; `scripts/kill-matrix --afresh` runs all again.

**F**: the test failed, so the fault is caught. ·: it passed. E: it ended in error: no answer. ?: not run.
"""


def problems(cells: Cells, tests: Sequence[ShippedTest]) -> list[str]:
    """What is not as it has to be, a sentence each."""
    return [*_of_the_good(cells), *(line for fault in FAULTS.values() for line in _of(fault, cells, tests))]


def write(path: Path, cells: Cells, tests: Sequence[ShippedTest]) -> None:
    """The page of what has run."""
    kinds = list(dict.fromkeys(fault.kind for fault in FAULTS.values()))
    parts = [
        _head(cells, tests),
        _legend(tests),
        *(_table(kind, cells, tests) for kind in kinds),
        of_ranges(),
        of_ros(),
    ]
    write_text(path, "\n".join([*parts, _reasons(cells), _gaps(cells, tests), faults.section(faults.read())]))


def _of_the_good(cells: Cells) -> Iterator[str]:
    for slug, cell in cells.get(GOOD, {}).items():
        if cell.outcome != "passed":
            yield f"the example does not pass {slug}: {cell.reason}"


def _of(fault: Fault, cells: Cells, tests: Sequence[ShippedTest]) -> Iterator[str]:
    row = cells.get(fault.name, {})
    for slug, each in row.items():
        if each.outcome == "error":
            yield f"{fault.name}: {slug} ended in error: {each.reason}"
    cell = row.get(fault.test)
    if cell is not None and not (cell.outcome == "failed" and re.search(fault.words, cell.reason)):
        yield f"{fault.name}: expected '{fault.words}' of {fault.test}, which {cell.outcome}: {cell.reason}"
    for kind in sorted(_silent_kinds(row, tests)):
        if not _why(fault, kind):
            yield f"{fault.name}: tests of kind {kind} pass, and gaps.yml does not say why"


def _silent_kinds(row: Mapping[str, Cell], tests: Sequence[ShippedTest]) -> set[str]:
    """Kinds of tests of which one or more passed."""
    return {test.kind for test in tests if test.slug in row and row[test.slug].outcome == "passed"}


def _why(fault: Fault, kind: str) -> str:
    reasons = GAPS.get(kind, {})
    return reasons.get(fault.name, reasons.get(fault.kind, ""))


def _head(cells: Cells, tests: Sequence[ShippedTest]) -> str:
    caught = sum(any(c.outcome == "failed" for c in cells.get(name, {}).values()) for name in FAULTS)
    passed = not list(_of_the_good(cells))
    good = "The example itself passes all tests." if passed else "The example itself does not pass all tests."
    slugs = {test.slug for test in tests}
    run = sum(len(slugs & cells.get(name, {}).keys()) for name in FAULTS)
    counts = {"faults": len(FAULTS), "tests": len(tests), "run": run, "all": len(FAULTS) * len(tests)}
    return HEAD.format(caught=caught, good=good, **counts)


def _legend(tests: Sequence[ShippedTest]) -> str:
    rows = [f"| {number} | `{test.slug}` | {test.kind} |" for number, test in enumerate(tests, 1)]
    return "\n".join(["| | test | kind |", "|---|---|---|", *rows, ""])


def _table(kind: str, cells: Cells, tests: Sequence[ShippedTest]) -> str:
    numbers = " | ".join(str(number) for number in range(1, len(tests) + 1))
    rows = [
        f"| `{fault.name}` | {fault.does} | {' | '.join(_mark(cells, fault.name, test.slug) for test in tests)} |"
        for fault in FAULTS.values()
        if fault.kind == kind
    ]
    head = [f"## Faults of {kind}", "", f"| fault | what it does | {numbers} |", "|---|---|" + "---|" * len(tests)]
    return "\n".join([*head, *rows, ""])


def of_ranges() -> str:
    """Those of another application, which a test of this repository runs against the test of that."""
    rows = [f"| `{fault.name}` | {fault.does} | {fault.test} |" for fault in RANGES.values()]
    head = [
        "## Faults of ranges",
        "",
        "Those of [examples/ranges](../examples/ranges/README.md); the test of that application catches each:",
        "",
    ]
    return "\n".join([*head, "| fault | what it does | test |", "|---|---|---|", *rows, ""])


def of_ros() -> str:
    rows = [f"| `{fault.name}` | {fault.does} | {fault.test} | {fault.words} |" for fault in ROS.values()]
    head = [
        "## Faults of ROS 2 nodes",
        "",
        "Those of [examples/ros](../examples/ros/README.md), on real rclpy and Fast DDS; its tests catch each,",
        "and the result has these words:",
        "",
    ]
    return "\n".join([*head, "| fault | what it does | test | words |", "|---|---|---|---|", *rows, ""])


def _mark(cells: Cells, fault: str, slug: str) -> str:
    cell = cells.get(fault, {}).get(slug)
    return MARKS[cell.outcome] if cell else NOT_RUN


def _reasons(cells: Cells) -> str:
    rows = []
    for fault in FAULTS.values():
        cell = cells.get(fault.name, {}).get(fault.test)
        if cell is not None and cell.outcome == "failed":
            rows.append(f"| `{fault.name}` | `{fault.test}` | {_short(cell.reason)} |")
    return "\n".join(["## What the tests say", "", "| fault | test | reason |", "|---|---|---|", *rows, ""])


def _short(reason: str) -> str:
    text = reason.replace("|", "\\|")
    return text if len(text) <= LONGEST else text[: text.rindex(" ", 0, LONGEST)] + " ..."


def _gaps(cells: Cells, tests: Sequence[ShippedTest]) -> str:
    found: dict[tuple[str, str], list[str]] = {}
    for fault in FAULTS.values():
        for kind in sorted(_silent_kinds(cells.get(fault.name, {}), tests)):
            found.setdefault((kind, _why(fault, kind)), []).append(f"`{fault.name}`")
    rows = [f"| {kind} | {', '.join(names)} | {why} |" for (kind, why), names in sorted(found.items())]
    head = [
        "## What they do not catch, and why",
        "",
        "Tests of a kind of which one or more pass with these faults:",
        "",
    ]
    return "\n".join([*head, "| kind of test | faults | why |", "|---|---|---|", *rows, ""])
