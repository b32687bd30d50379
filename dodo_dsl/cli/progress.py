"""Live progress of a run: a table on a terminal, plain lines elsewhere."""

import time
from collections.abc import Sequence
from typing import Self, TextIO

from dodo_dsl.cli import display
from dodo_dsl.cli.display import Verbosity
from dodo_dsl.diagnostics import Piece
from dodo_dsl.outcome import Outcome
from dodo_dsl.run.run_state import Standing
from dodo_dsl.run.runner import Progress
from dodo_dsl.terminal import printable


def summary_line(outcome: Outcome, width: int) -> list[Piece]:
    """One line about a finished test, in parts."""
    times = ""
    if outcome.setup_s is not None and outcome.execution_s is not None:
        times = f" (set-up {outcome.setup_s:.1f} s, ran {outcome.execution_s:.1f} s)"
    verdict = (f"{outcome.outcome.upper():<6}", display.OF_OUTCOMES[outcome.outcome])
    return [verdict, (f"  {printable(outcome.name):<{width}}  {printable(outcome.reason)}{times}\n", "")]


class PlainProgress:
    """One line per phase, with the seconds since the start of the run."""

    def __init__(self, stream: TextIO, slugs: Sequence[str]) -> None:
        self.stream = stream
        self.width = max(map(len, slugs), default=0)
        self.start = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stream.flush()

    def note(self, text: str) -> None:
        self.stream.write(f"{printable(text)}\n")
        self.stream.flush()

    def phase(self, slug: str, text: str) -> None:
        self.note(self._head(slug) + text)

    def standing(self, slug: str, standing: Standing) -> None:
        """How far a test is takes no line of its own."""

    def done(self, outcome: Outcome) -> None:
        verdict = (outcome.outcome, display.OF_OUTCOMES[outcome.outcome])
        display.write_coloured(self.stream, [(self._head(outcome.slug), ""), verdict, ("\n", "")])
        self.stream.flush()

    def _head(self, slug: str) -> str:
        """The begin of a line about a test."""
        return f"[{time.monotonic() - self.start:6.1f} s] {printable(slug):<{self.width}}  "

    def rest(self, seconds: float, tests: int) -> None:
        self.note(f"[{time.monotonic() - self.start:6.1f} s] {count(tests)} to go, {about(seconds)}")


class NoProgress:
    """Shows nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def note(self, text: str) -> None:
        pass

    def phase(self, slug: str, text: str) -> None:
        pass

    def standing(self, slug: str, standing: Standing) -> None:
        pass

    def done(self, outcome: Outcome) -> None:
        pass

    def rest(self, seconds: float, tests: int) -> None:
        pass


def count(number: int, what: str = "test") -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def about(seconds: float) -> str:
    """A forecast in words."""
    return f"about {seconds / 60:.0f} min" if seconds > 180 else f"about {seconds:.0f} s"


def choose(stream: TextIO, slugs: Sequence[str], verbosity: Verbosity = Verbosity.NORMAL) -> Progress:
    if verbosity is Verbosity.QUIET:
        return NoProgress()
    if verbosity is Verbosity.VERBOSE or not display.commands_terminal(stream):
        return PlainProgress(stream, slugs)
    from dodo_dsl.cli.live_table import LiveProgress

    return LiveProgress(stream, slugs)
