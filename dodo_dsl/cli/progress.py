"""Live progress of a run: a table on a terminal, plain lines elsewhere."""

import time
from collections.abc import Sequence
from typing import Self, TextIO

from dodo_dsl.cli import display
from dodo_dsl.cli.display import Verbosity
from dodo_dsl.outcome import ON_EMULATED, Outcome
from dodo_dsl.plan.model import LAYERS
from dodo_dsl.run.runner import Progress
from dodo_dsl.terminal import printable

_STEPS = ("taking down", *(f"waiting for {layer}" for layer in LAYERS))
"""Phases that only ``-v`` shows."""


def ending(outcome: Outcome) -> str:
    """What follows the word for an outcome: whether its rig was emulated, and why, where a test did not pass."""
    where = " (emulated)" if ON_EMULATED in outcome.notes else ""
    return where if outcome.outcome == "passed" else f"{where}: {printable(outcome.reason)}"


class NoProgress:
    """Shows nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...

    def note(self, text: str) -> None: ...

    def phase(self, slug: str, text: str) -> None: ...

    def done(self, outcome: Outcome) -> None: ...


class PlainProgress(NoProgress):
    """A line for each phase, with the seconds since the start of the run."""

    def __init__(self, stream: TextIO, slugs: Sequence[str], is_verbose: bool = False) -> None:
        self.stream = stream
        self.is_verbose = is_verbose
        self.width = max(map(len, slugs), default=0)
        self.start = time.monotonic()

    def note(self, text: str) -> None:
        self.stream.write(f"{printable(text)}\n")
        self.stream.flush()

    def phase(self, slug: str, text: str) -> None:
        if self.is_verbose or text not in _STEPS:
            self.note(self._head(slug) + text)

    def done(self, outcome: Outcome) -> None:
        verdict = (outcome.outcome, display.OF_OUTCOMES[outcome.outcome])
        display.write_coloured(self.stream, [(self._head(outcome.slug), ""), verdict, (f"{ending(outcome)}\n", "")])
        self.stream.flush()

    def _head(self, slug: str) -> str:
        """The start of a line about a test."""
        return f"[{time.monotonic() - self.start:6.1f} s] {printable(slug):<{self.width}}  "


def count(number: int, what: str = "test") -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def choose(stream: TextIO, slugs: Sequence[str], verbosity: Verbosity = Verbosity.NORMAL) -> Progress:
    if verbosity is Verbosity.QUIET:
        return NoProgress()
    if verbosity is Verbosity.VERBOSE or not display.commands_terminal(stream):
        return PlainProgress(stream, slugs, verbosity is Verbosity.VERBOSE)
    from dodo_dsl.cli.live_table import LiveProgress

    return LiveProgress(stream, slugs)
