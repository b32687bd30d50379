"""Draws what a report has of each test as soon as the test has ended, beside the tests that still run."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Self

from dodo_dsl.outcome import Outcome
from dodo_dsl.report.report_folder import Drawable, draw_test


class Drawings:
    """The pictures and pages of tests in a report's folder, drawn one after the other in a thread of their own.

    What was begun is whole when the context ends; after an exception, no further one begins.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._pool = ThreadPoolExecutor(1, "drawing")
        self._begun: dict[str, Future[list[str]]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, _error: object, _trace: TracebackType | None) -> None:
        self._pool.shutdown(cancel_futures=kind is not None)

    def begin(self, outcome: Outcome, test: Drawable) -> None:
        """Draws the test of this outcome, which is final."""
        self._begun[outcome.slug] = self._pool.submit(draw_test, self._folder, outcome, test)

    def problems(self) -> Mapping[str, Sequence[str]]:
        """The slugs of all tests that were drawn, with sentences on what could not be."""
        return {slug: future.result() for slug, future in self._begun.items()}
