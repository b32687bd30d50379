"""The faults and outcomes of ``docs/evidence.md``: tests write these rows, or compare them with it."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import atomic

PAGE = Path(__file__).parents[1] / "docs" / "evidence.md"
FAULTS = (
    "An image is missing",
    "The engine goes away in the middle of a test",
    "The application is killed",
    "The application takes more memory than it may",
    "A child of the application takes more memory than it may",
    "A service of DoDo's is killed",
    "A service never gets ready",
    "The disk with the report is full",
    "The runner is killed, and run again",
    "Two runners at once",
    "5% of all messages are lost, the others come 50 ms late",
    "The wall clock jumps",
    "The application logs 10,000 lines a second",
    "The application logs a line of 5 MB",
)
BACKENDS = ("process", "docker", "mixed")
TOP = """## When something around a test breaks

The outcome of a test when something around it goes wrong, and DoDo's message. *Failed* is the application's
fault; *error* means that DoDo could not judge it. In each case nothing is left behind (processes,
containers, networks, volumes, shared memory, leases), or the next run removes it and reports that, and tests that run
at the same time are not affected.

The tests that cause these faults write this table: `scripts/make-faults` runs them. N is a number.

| fault | backend | outcome | message |
|---|---|---|---|
"""
_NUMBERS = (
    (r"(after|within|of) \d+(\.\d+)? s\b", r"\1 N s"),
    (r"\d+ (containers|processes|messages|shared memories)", r"N \1"),
    (r"\b127\.0\.0\.1:\d+", "127.0.0.1:N"),
    (r"(cannot be pulled|went away): .*", r"\1: (message of the engine)"),
)


@dataclass(frozen=True, order=True)
class Row:
    """One fault on one backend, with the outcome and the message of a test."""

    fault: str
    backend: str
    outcome: str
    sentence: str

    def markdown(self) -> str:
        return f"| {self.fault} | {self.backend} | {self.outcome} | {self.sentence} |\n"


def normal(sentence: str) -> str:
    """A message without the parts that differ from run to run."""
    for pattern, instead in _NUMBERS:
        sentence = re.sub(pattern, instead, sentence)
    return sentence.replace("|", "/")


def read() -> list[Row]:
    """The rows of the committed page."""
    text = PAGE.read_text(encoding="utf-8")
    found = re.findall(r"^\| (.+) \| (process|docker|mixed) \| (\w+) \| (.+) \|$", text, re.MULTILINE)
    return [Row(*cells) for cells in found]


def section(rows: Iterable[Row]) -> str:
    """The part of the page with rows, in the order of FAULTS, without rows of other faults."""
    known = [row for row in set(rows) if row.fault in FAULTS]
    ordered = sorted(known, key=lambda row: (FAULTS.index(row.fault), BACKENDS.index(row.backend)))
    return TOP + "".join(row.markdown() for row in ordered)


@dataclass(frozen=True)
class Book:
    """Compares the results of tests with the page, or with ``update`` writes them there."""

    update: bool

    def record(self, fault: str, backend: str, outcome: str, sentence: str) -> None:
        row = Row(fault, backend, outcome, normal(sentence))
        assert fault in FAULTS, f"'{fault}' is not one of the faults of the page"
        if self.update:
            others = [r for r in read() if (r.fault, r.backend) != (fault, backend)]
            above = PAGE.read_text(encoding="utf-8").partition(TOP.partition("\n")[0])[0]
            atomic.write_text(PAGE, above + section([*others, row]))
        assert row in read(), f"scripts/make-faults updates docs/evidence.md: {row.markdown()}"
