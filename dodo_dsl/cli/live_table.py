"""The table that a terminal shows while tests run: a line for each, with its phase and how long that has lasted."""

from collections import Counter
from collections.abc import Sequence
from typing import Any, Self, TextIO

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

from dodo_dsl.cli.progress import NoProgress, count, ending
from dodo_dsl.outcome import Outcome
from dodo_dsl.terminal import printable, unescaped

_STYLES = {"passed": "green", "failed": "red", "error": "yellow"}


class LiveProgress(NoProgress):
    """A line for all tests and each running one; those that did not pass stand above. No text is rich's markup."""

    def __init__(self, stream: TextIO, slugs: Sequence[str]) -> None:
        self._width, self._all = max(map(len, slugs), default=0), len(slugs)
        texts = (TextColumn(f"{{task.{what}}}", markup=False) for what in ("description", "fields[state]"))
        console = Console(file=unescaped(stream))
        self._rows = Progress(SpinnerColumn(), *texts, TimeElapsedColumn(), console=console, transient=True)
        self._rest = self._rows.add_task("", total=None, state=f"{count(self._all)} to go")
        self._tasks: dict[str, Any] = {}
        self._ended: Counter[str] = Counter()

    def __enter__(self) -> Self:
        self._rows.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._rows.stop()

    def note(self, text: str) -> None:
        self._rows.console.print(printable(text), markup=False, emoji=False)

    def phase(self, slug: str, text: str) -> None:
        self._forget(slug)
        self._tasks[slug] = self._rows.add_task(slug, total=None, state=printable(text))

    def done(self, outcome: Outcome) -> None:
        self._forget(outcome.slug)
        self._ended[outcome.outcome] += 1
        if outcome.outcome != "passed":
            name = f"{printable(outcome.slug):<{self._width}}  "
            verdict = (outcome.outcome, _STYLES[outcome.outcome])
            self._rows.console.print(Text.assemble(name, verdict, ending(outcome)))
        ended = "".join(f"{self._ended[kind]} {kind}, " for kind in _STYLES if self._ended[kind])
        self._rows.update(self._rest, state=f"{ended}{count(self._all - self._ended.total())} to go")

    def _forget(self, slug: str) -> None:
        if slug in self._tasks:
            self._rows.remove_task(self._tasks.pop(slug))
