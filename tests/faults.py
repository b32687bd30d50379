"""The page of faults and outcomes, ``docs/faults.md``: tests make its rows and find them in it."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import atomic

PAGE = Path(__file__).parents[1] / "docs" / "faults.md"
FAULTS = (
    "An image is missing",
    "The connection breaks in the middle of a pull",
    "The engine goes away in the middle of a test",
    "The application is killed",
    "The application takes more memory than it may",
    "A service of DoDo's is killed",
    "An evaluator ends without a verdict",
    "An evaluator gives two verdicts",
    "An evaluator gives a malformed verdict",
    "A service never gets ready",
    "The disk with the report is full",
    "The runner is killed, and run again",
    "Two runners at once",
    "5% of all messages are lost, the others come 50 ms late",
    "The wall clock jumps",
    "The application logs 10,000 lines a second",
    "The application logs a line of 5 MB",
)
TOP = """# Faults

What becomes of a test when something goes wrong around it, and the sentence with which DoDo says so. *Failed* blames
the application; *error* means that there is no answer about it. In each case nothing stays behind (processes,
containers, networks, volumes, shared memory, leases), or the next run removes it and says so, and tests that run at
the same time do not notice.

This page is made by the tests that cause these faults: `scripts/make-faults` runs them and writes it. N is a number.

| fault | backend | outcome | what DoDo says |
|---|---|---|---|
"""
_NUMBERS = (
    (r"(after|within|of) \d+(\.\d+)? s\b", r"\1 N s"),
    (r"\d+ (containers|processes|messages|shared memories)", r"N \1"),
    (r"\b127\.0\.0\.1:\d+", "127.0.0.1:N"),
    (r"(cannot be pulled|went away): .*", r"\1: (what the engine says)"),
)


@dataclass(frozen=True, order=True)
class Row:
    """One fault on one backend, and what a run made of it."""

    fault: str
    backend: str
    outcome: str
    sentence: str

    def markdown(self) -> str:
        return f"| {self.fault} | {self.backend} | {self.outcome} | {self.sentence} |\n"


def normal(sentence: str) -> str:
    """A sentence without what differs from run to run."""
    for pattern, instead in _NUMBERS:
        sentence = re.sub(pattern, instead, sentence)
    return sentence.replace("|", "/")


def read() -> list[Row]:
    """The rows of the committed page."""
    text = PAGE.read_text(encoding="utf-8") if PAGE.is_file() else ""
    found = re.findall(r"^\| (.+) \| (process|docker) \| (\w+) \| (.+) \|$", text, re.MULTILINE)
    return [Row(*cells) for cells in found]


def page(rows: Iterable[Row]) -> str:
    """The page of rows, in the order of FAULTS; what is no fault any more is left out."""
    known = [row for row in set(rows) if row.fault in FAULTS]
    ordered = sorted(known, key=lambda row: (FAULTS.index(row.fault), row.backend != "process"))
    return TOP + "".join(row.markdown() for row in ordered)


@dataclass(frozen=True)
class Book:
    """Takes what tests find: compares it with the page, or with ``update`` writes it there."""

    update: bool

    def record(self, fault: str, backend: str, outcome: str, sentence: str) -> None:
        row = Row(fault, backend, outcome, normal(sentence))
        assert fault in FAULTS, f"'{fault}' is not among the faults of the page"
        if self.update:
            others = [r for r in read() if (r.fault, r.backend) != (fault, backend)]
            atomic.write_text(PAGE, page([*others, row]))
        assert row in read(), f"scripts/make-faults brings docs/faults.md up to date: {row.markdown()}"
