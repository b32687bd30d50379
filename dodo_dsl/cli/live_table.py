"""The table that a terminal shows while tests run: a line for each, with its phase, its own time and how fast it is."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Self, TextIO

from rich.console import Console, RenderableType
from rich.progress import Progress as Bars
from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

from dodo_dsl.cli.progress import NoProgress, about, count, ending
from dodo_dsl.outcome import Outcome
from dodo_dsl.run.run_state import Standing
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
        self._width = max(map(len, slugs), default=0)
        self._progress: Any = _Bars(
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            TextColumn("{task.fields[state]}", markup=False),
            TimeElapsedColumn(),
            TextColumn("{task.fields[standing]}", markup=False),
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
        fields = {"state": printable(text), "standing": ""}
        self._tasks[slug] = self._progress.add_task(slug, total=None, **fields)

    def standing(self, slug: str, standing: Standing) -> None:
        own = f"{standing.seconds:.1f} s of test time" if standing.is_lockstep else ""
        if slug in self._tasks:
            self._progress.update(self._tasks[slug], standing=own)

    def done(self, outcome: Outcome) -> None:
        self._ended[outcome.outcome] += 1
        if outcome.outcome != "passed":
            name = f"{printable(outcome.slug):<{self._width}}  "
            verdict = (outcome.outcome, _STYLES[outcome.outcome])
            self._progress.console.print(Text.assemble(name, verdict, ending(outcome)))
        if (task := self._tasks.pop(outcome.slug, None)) is not None:
            self._progress.remove_task(task)

    def rest(self, seconds: float, tests: int) -> None:
        ended = "".join(f"{self._ended[kind]} {word}, " for kind, word in _WORDS.items() if self._ended[kind])
        self._progress.rest = f"{ended}{count(tests)} to go, {about(seconds)}"
