"""``dodo compile --search``: the tests that a pipeline searches."""

from collections.abc import Sequence
from pathlib import Path

from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.diagnostics import format_text, has_errors, ordered
from dodo_dsl.emit.pipeline import SearchJobs
from dodo_dsl.search.study import refuse_search
from dodo_dsl.spec.settings import Settings

MOST_WORKERS = 200
"""GitLab's limit of ``parallel``."""


def search_jobs(words: Sequence[str], workers: int, application: Sequence[Path]) -> tuple[SearchJobs, ...]:
    """Jobs for each test once; raises UsageError for a word that is none that can be searched."""
    if workers > MOST_WORKERS:
        raise UsageError(f"--workers {workers} is more than the {MOST_WORKERS} jobs that GitLab runs in parallel")
    files = tuple(path.as_posix() for path in application)
    found: dict[str, SearchJobs] = {}
    for word in words:
        checked = selection.select([word], (), application, Settings("lockstep"))
        if has_errors(checked.diagnostics):
            raise UsageError(f"'{word}' cannot be searched:\n{format_text(ordered(checked.diagnostics))}")
        refuse_search(word, checked.tests)
        slug = checked.tests[0].spec.slug
        found.setdefault(slug, SearchJobs(word, slug, workers, files))
    return tuple(found.values())
