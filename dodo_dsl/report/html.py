"""``index.html``: the run at a glance, in one file without scripts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jinja2

from dodo_dsl import __version__, package_data
from dodo_dsl.outcome import Outcome
from dodo_dsl.report.junit import check_line


class Picture(NamedTuple):
    """A picture of a test: its path relative to the page, and what it shows."""

    path: str
    text: str


@dataclass(frozen=True)
class Files:
    """What lies beside the page, as paths relative to it, by slug; ``times`` is one picture's path or empty."""

    pictures: Mapping[str, Sequence[Picture]]
    logs: Mapping[str, Sequence[str]]
    recordings: Mapping[str, str]
    specs: Mapping[str, str]
    times: str = ""


MEANINGS = {
    "outside": "samples at times for which there is no target, left out",
    "broken": "samples that are no finite numbers",
    "without-truth": "frames of which nobody knows what is in them, left out",
    "late": "detections that came when their frame was judged already, left out",
    "repeated": "detections under a detectionId that their frame had already, left out",
}
"""Of checks whose names do not say it; as the READMEs of the evaluators have them."""


def render(outcomes: Sequence[Outcome], files: Files) -> str:
    """The page."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(package_data.templates()), undefined=jinja2.StrictUndefined, autoescape=True
    )
    counts = {kind: sum(o.outcome == kind for o in outcomes) for kind in ("passed", "failed", "error")}
    return environment.get_template("report.html.j2").render(
        outcomes=outcomes, files=files, meanings=MEANINGS, counts=counts, version=__version__, check_line=check_line
    )
