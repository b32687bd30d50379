"""The table that a terminal shows while tests run: a line for each, with its phase and how long that has lasted."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Self, TextIO

from rich.console import Console, RenderableType
from rich.progress import Progress as Bars
from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

from dodo_dsl.cli.progress import NoProgress, count, ending
from dodo_dsl.outcome import Outcome
from dodo_dsl.terminal import printable, unescaped

_STYLES = {"passed": "green", "failed": "red", "error": "yellow"}
_WORDS = {"passed": "passed", "failed": "failed", "error": "in error"}


class _Bars(Bars):
    """The lines of running tests, and below them one on all others."""

    rest = ""

    def get_renderables(self) -> Iterable[RenderableType]:
        yield from super().get_renderables()
        if self.rest:
            yield Text(self.rest)


class LiveProgress(NoProgress):
    """A line for each running test; those that did not pass stand above. Texts of services are never rich's markup."""

    def __init__(self, stream: TextIO, slugs: Sequence[str]) -> None:
        self._width, self._all = max(map(len, slugs), default=0), len(slugs)
        self._progress: Any = _Bars(
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            TextColumn("{task.fields[state]}", markup=False),
            TimeElapsedColumn(),
            console=Console(file=unescaped(stream)),
            transient=True,
        )
        self._tasks: dict[str, Any] = {}
        self._ended: Counter[str] = Counter()

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def note(self, text: str) -> None:
        self._progress.console.print(printable(text), markup=False, emoji=False)

    def phase(self, slug: str, text: str) -> None:
        if slug in self._tasks:
            self._progress.remove_task(self._tasks[slug])
        self._tasks[slug] = self._progress.add_task(slug, total=None, state=printable(text))

    def done(self, outcome: Outcome) -> None:
        self._ended[outcome.outcome] += 1
        if outcome.outcome != "passed":
            name = f"{printable(outcome.slug):<{self._width}}  "
            verdict = (outcome.outcome, _STYLES[outcome.outcome])
            self._progress.console.print(Text.assemble(name, verdict, ending(outcome)))
        if (task := self._tasks.pop(outcome.slug, None)) is not None:
            self._progress.remove_task(task)
        ended = "".join(f"{self._ended[kind]} {word}, " for kind, word in _WORDS.items() if self._ended[kind])
        self._progress.rest = f"{ended}{count(self._all - self._ended.total())} to go"
