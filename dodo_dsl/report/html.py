"""``index.html``: the run at a glance, in one file without scripts."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jinja2

from dodo_dsl import __version__, data
from dodo_dsl.outcome import Outcome
from dodo_dsl.report.junit import check_line


class Picture(NamedTuple):
    """A picture of a test: its path relative to the page, and what it shows."""

    path: str
    text: str


def render(
    outcomes: Sequence[Outcome],
    pictures: Mapping[str, Sequence[Picture]],
    logs: Mapping[str, Sequence[str]],
    times: str = "",
) -> str:
    """The page; ``pictures``, and ``logs`` as paths relative to it, by slug; ``times`` a picture's path or empty."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(data.templates()), undefined=jinja2.StrictUndefined, autoescape=True
    )
    counts = {kind: sum(o.outcome == kind for o in outcomes) for kind in ("passed", "failed", "error")}
    return environment.get_template("report.html.j2").render(
        outcomes=outcomes,
        pictures=pictures,
        logs=logs,
        times=times,
        counts=counts,
        version=__version__,
        check_line=check_line,
    )
