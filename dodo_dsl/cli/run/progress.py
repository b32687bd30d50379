"""Live progress of a run: a moving display on a terminal, plain lines elsewhere."""

import time
from collections.abc import Sequence
from typing import Any, Self, TextIO

from dodo_dsl.outcome import Outcome
from dodo_dsl.terminal import printable, unescaped

_STYLES = {"passed": "green", "failed": "red", "error": "yellow"}


def summary_line(outcome: Outcome, width: int) -> str:
    """One line about a finished test."""
    times = ""
    if outcome.setup_s is not None and outcome.execution_s is not None:
        times = f" (set-up {outcome.setup_s:.1f} s, ran {outcome.execution_s:.1f} s)"
    return f"{outcome.outcome.upper():<6}  {printable(outcome.name):<{width}}  {printable(outcome.reason)}{times}"


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
        self.note(f"[{time.monotonic() - self.start:6.1f} s] {slug:<{self.width}}  {text}")

    def done(self, outcome: Outcome) -> None:
        self.phase(outcome.slug, outcome.outcome)

    def rest(self, seconds: float, tests: int) -> None:
        self.note(f"[{time.monotonic() - self.start:6.1f} s] {count(tests)} to go, {about(seconds)}")


class LiveProgress:
    """One moving line per test. Texts of services are never read as rich's markup."""

    def __init__(self, stream: TextIO, slugs: Sequence[str]) -> None:
        from rich.console import Console
        from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        fields = ("description", "fields[outcome]", "fields[state]")
        columns = [TextColumn(f"{{task.{name}}}", markup=name == "fields[outcome]") for name in fields]
        self._progress: Any = Progress(
            SpinnerColumn(), *columns, TimeElapsedColumn(), console=Console(file=unescaped(stream))
        )
        self._rest: Any = None
        self._tasks = {s: self._add(s, "waiting") for s in slugs}

    def _add(self, description: str, state: str) -> Any:
        return self._progress.add_task(description, total=None, start=not description, outcome="", state=state)

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def note(self, text: str) -> None:
        self._progress.console.print(printable(text), markup=False, emoji=False)

    def phase(self, slug: str, text: str) -> None:
        self._progress.start_task(self._tasks[slug])
        self._progress.update(self._tasks[slug], state=printable(text))

    def done(self, outcome: Outcome) -> None:
        style = _STYLES[outcome.outcome]
        text = f"[{style}]{outcome.outcome}[/]"
        self._progress.update(self._tasks[outcome.slug], outcome=text, state="", total=1, completed=1)

    def rest(self, seconds: float, tests: int) -> None:
        if self._rest is None:
            self._rest = self._add("", "")
        self._progress.update(self._rest, state=f"{count(tests)} to go, {about(seconds)}")


def count(number: int, what: str = "test") -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def about(seconds: float) -> str:
    """A forecast in words."""
    return f"about {seconds / 60:.0f} min" if seconds > 180 else f"about {seconds:.0f} s"


def choose(stream: TextIO, slugs: Sequence[str]) -> PlainProgress | LiveProgress:
    return LiveProgress(stream, slugs) if stream.isatty() else PlainProgress(stream, slugs)
