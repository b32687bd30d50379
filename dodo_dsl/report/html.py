"""``index.html``: the run at a glance, in one file without scripts, with a link to the drive of each test."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jinja2

from dodo_dsl import __version__, package_data
from dodo_dsl.outcome import Outcome
from dodo_dsl.report.junit import check_line
from dodo_dsl.report.machine_line import machine_line


class ReportPicture(NamedTuple):
    """A picture of a test: its path relative to the page, and what it shows."""

    path: str
    text: str


@dataclass(frozen=True)
class ReportFiles:
    """The files beside the page, as paths relative to it, by slug; ``times`` is the path of one picture, or empty."""

    pictures: Mapping[str, Sequence[ReportPicture]]
    logs: Mapping[str, Sequence[str]]
    recordings: Mapping[str, str]
    specs: Mapping[str, str]
    drives: Mapping[str, str]
    times: str = ""


MEANINGS = {
    "outside": "samples at times without a target, ignored",
    "broken": "samples that are not finite numbers",
    "without-truth": "frames without ground truth, ignored",
    "late": "samples or detections that came too late to be judged, ignored",
    "repeated": "detections with a detectionId that their frame already had, ignored",
}
"""Explanations of checks whose names do not explain them, as in the READMEs of the evaluators."""


def render(outcomes: Sequence[Outcome], files: ReportFiles) -> str:
    """The page."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(package_data.templates()),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        finalize=_without_control,
    )
    counts = {kind: sum(o.outcome == kind for o in outcomes) for kind in ("passed", "failed", "error")}
    return environment.get_template("report.html.j2").render(
        outcomes=outcomes,
        files=files,
        meanings=MEANINGS,
        counts=counts,
        version=__version__,
        check_line=check_line,
        machine_line=machine_line,
    )


def _without_control(value: Any) -> Any:
    """No control characters but line ends and tabs: they would command the terminal of who looks at the source."""
    if not isinstance(value, str) or value.isprintable():
        return value
    plain = "".join(c if c.isprintable() or c in "\n\t" else "\ufffd" for c in value)
    return type(value)(plain)  # what is marked as safe stays so
