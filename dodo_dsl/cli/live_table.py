"""The table that a terminal shows while tests run: a line for each, with its phase, its own time and how fast it is."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Self, TextIO

from rich.console import Console, RenderableType
from rich.progress import Progress as Bars
from rich.progress import ProgressColumn, SpinnerColumn, Task, TextColumn
from rich.text import Text

from dodo_dsl.cli.progress import about, count, ending
from dodo_dsl.outcome import Outcome
from dodo_dsl.run.run_state import Standing
from dodo_dsl.terminal import printable, unescaped

_STYLES = {"passed": "green", "failed": "red", "error": "yellow"}
_WORDS = {"passed": "passed", "failed": "failed", "error": "in error"}
_FIELDS = {"state": "", "pace": None}


@dataclass(frozen=True)
class Pace:
    """The own time of a test that runs since ``began``; in lockstep as it stood at ``told``. Seconds."""

    began: float
    told: float
    standing: Standing

    def text(self, now: float) -> str:
        """The test's own time, and in lockstep how many times faster than real time it has been."""
        if not self.standing.is_lockstep:
            return f"{now - self.began:.1f} s"
        seconds, wall = self.standing.seconds, self.told - self.began
        factor = f"  x{seconds / wall:.1f}" if seconds and wall > 0 else ""
        return f"{seconds:.1f} s{factor}"


class _PaceColumn(ProgressColumn):
    def __init__(self, now: Callable[[], float]) -> None:
        super().__init__()
        self._now = now

    def render(self, task: Task) -> Text:
        pace = task.fields["pace"]
        return Text(pace.text(self._now()) if pace else "")


class _Bars(Bars):
    """The lines of running tests, and below them one on all others."""

    rest = ""

    def get_renderables(self) -> Iterable[RenderableType]:
        yield from super().get_renderables()
        if self.rest:
            yield Text(self.rest)


class LiveProgress:
    """A line for each running test; those that did not pass stand above. Texts of services are never rich's markup."""

    def __init__(self, stream: TextIO, slugs: Sequence[str], now: Callable[[], float] = time.monotonic) -> None:
        """``now`` gives seconds that never go back."""
        self._now = now
        self._width = max(map(len, slugs), default=0)
        self._progress: Any = _Bars(
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            TextColumn("{task.fields[state]}", markup=False),
            _PaceColumn(now),
            console=Console(file=unescaped(stream)),
            transient=True,
        )
        self._tasks: dict[str, Any] = {}
        self._began: dict[str, float] = {}
        self._ended: Counter[str] = Counter()

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def note(self, text: str) -> None:
        self._progress.console.print(printable(text), markup=False, emoji=False)

    def phase(self, slug: str, text: str) -> None:
        if slug not in self._tasks:
            self._tasks[slug] = self._progress.add_task(slug, total=None, **_FIELDS)
        self._began.pop(slug, None)
        self._progress.update(self._tasks[slug], **{**_FIELDS, "state": printable(text)})

    def standing(self, slug: str, standing: Standing) -> None:
        now = self._now()
        pace = Pace(self._began.setdefault(slug, now), now, standing)
        if slug in self._tasks:
            self._progress.update(self._tasks[slug], pace=pace)

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
