"""A progress bar on a terminal for long work; nothing elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from dodo_dsl.terminal import printable, unescaped


@contextmanager
def progress_bar(stream: TextIO, text: str, total: int) -> Iterator[Callable[[int], None]]:
    """Yields a function that takes how much of ``total`` is done."""
    if not stream.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import Progress, TextColumn

    columns = (TextColumn("{task.description}", markup=False), *Progress.get_default_columns()[1:])
    with Progress(*columns, console=Console(file=unescaped(stream)), transient=True) as progress:
        task = progress.add_task(printable(text), total=total)
        yield lambda done: progress.update(task, completed=done)
