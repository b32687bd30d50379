"""``index.html``: the run at a glance, in one file, with a link to the drive of each test.

It shows everything without its script, which searches, filters and sorts.
"""

import base64
import functools
import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup

from dodo_dsl import __version__, package_data
from dodo_dsl.outcome import Outcome, megabytes
from dodo_dsl.report import check_words
from dodo_dsl.report.changes import words
from dodo_dsl.report.changes.comparison import KINDS, Comparison
from dodo_dsl.report.results import NO_CIRCUMSTANCES, Circumstances
from dodo_dsl.report.suite import check_history, matrix_grid
from dodo_dsl.report.suite.machine_line import machine_line
from dodo_dsl.template_cache import compiled_templates


class ReportPicture(NamedTuple):
    """A picture of a test: its path relative to the page, and what it shows."""

    path: str
    text: str


@dataclass(frozen=True)
class ReportFiles:
    """The files beside the page, as paths relative to it, by slug; ``times`` is the path of one picture, or empty.

    ``past`` are earlier values of checks.
    """

    pictures: Mapping[str, Sequence[ReportPicture]]
    logs: Mapping[str, Sequence[str]]
    recordings: Mapping[str, str]
    specs: Mapping[str, str]
    drives: Mapping[str, str]
    times: str = ""
    past: check_history.Past = field(default_factory=dict)


MEANINGS = {
    "outside": "samples at times without a target, ignored",
    "broken": "samples that are not finite numbers",
    "without-truth": "frames without ground truth, ignored",
    "late": "samples or detections that came too late to be judged, ignored",
    "repeated": "detections with a detectionId that their frame already had, ignored",
}
"""Explanations of checks whose names do not explain them, as in the READMEs of the evaluators."""


_BREAKS = re.compile(r"(?=\[)|(?<=,)")
_UNITS = re.compile(r"(?<=\d) (?=\S)")
_MOST_TEXT = 10_000
"""Characters of one text of others on the page."""
_URGENCIES = ("error", "failed", "passed")
_DIRECTIONS = ("worse", "better", "different")


def render(
    outcomes: Sequence[Outcome],
    files: ReportFiles,
    comparison: Comparison | None = None,
    circumstances: Circumstances = NO_CIRCUMSTANCES,
) -> str:
    """The page; with a comparison, what changed since the report that it names."""
    counts = {kind: sum(o.outcome == kind for o in outcomes) for kind in ("passed", "failed", "error")}
    script = (package_data.templates() / "report" / "suite.js").read_text(encoding="utf-8")
    return (
        environment()
        .get_template("report.html.j2")
        .render(
            outcomes=outcomes,
            files=files,
            meanings=MEANINGS,
            counts=counts,
            not_run=circumstances.not_run,
            runs=circumstances.runs,
            version=__version__,
            machine_line=machine_line,
            megabytes=megabytes,
            curve=check_history.curve,
            grids=matrix_grid.grids(outcomes),
            decisive_value=matrix_grid.decisive_value,
            comparison=comparison,
            changed=comparison.by_slug() if comparison else {},
            words=words,
            check_words=check_words,
            kinds=KINDS,
            directions=_DIRECTIONS,
            urgencies=_URGENCIES,
            script=script,
            style=style(),
            hash=source_hash,
            breakable=breakable,
            unbroken=unbroken,
        )
    )


def style() -> str:
    """The style sheet of pages."""
    return (package_data.templates() / "report" / "suite.css").read_text(encoding="utf-8")


@functools.cache
def environment() -> jinja2.Environment:
    """Renders pages of texts that come from strangers."""
    return jinja2.Environment(
        bytecode_cache=compiled_templates(),
        loader=jinja2.FileSystemLoader(package_data.templates()),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        finalize=_harmless,
    )


def breakable(name: str) -> Markup:
    """A test's name, which lines may break before its values and between them."""
    return Markup("<wbr>").join(_BREAKS.split(_harmless(name)))


def unbroken(text: str) -> Markup:
    """Values whose units stay in the line of their numbers."""
    return Markup("\u00a0").join(_UNITS.split(_harmless(text)))


def source_hash(text: str) -> str:
    """A script or style, as a Content-Security-Policy allows it alone (CSP level 3, section 2.3.1)."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _harmless(value: Any) -> Any:
    """No control characters but line ends and tabs: they would command the terminal of who looks at the source.

    A long text is cut.
    """
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    text = value[:_MOST_TEXT]
    plain = text if text.isprintable() else "".join(c if c.isprintable() or c in "\n\t" else "\ufffd" for c in text)
    return plain if text == value else f"{plain} … ({len(value)} characters)"
