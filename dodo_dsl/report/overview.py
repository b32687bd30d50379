"""``index.html``: the run at a glance, in one file, with a link to the drive of each test.

It shows everything without its script, which searches, filters and sorts. What checks measured in the latest runs is
kept beside the report and drawn as small curves.
"""

import base64
import functools
import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup

from dodo_dsl import __version__, atomic, package_data
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import MachineLoad, Outcome, Wait, megabytes
from dodo_dsl.report import comparison as report_comparison
from dodo_dsl.report.comparison import KINDS, Comparison
from dodo_dsl.report.instances import decisive_value, grids, worst_instances
from dodo_dsl.report.results import NO_CIRCUMSTANCES, Circumstances
from dodo_dsl.template_cache import compiled_templates


def machine_line(load: MachineLoad) -> str:
    """What application and services waited, what others took, and how many pictures were late."""
    parts = []
    if load.application is None or load.services is None or load.others_share is None:
        parts.append("waits for a processor were not measured")
    else:
        parts += [_waited("the application", load.application, load), _waited("DoDo's services", load.services, load)]
        parts.append(f"others took {load.others_share * 100:.0f} % of {load.cores} cores")
    if load.late_pictures_share:
        parts.append(
            f"{load.late_pictures_share * 100:.0f} % of the pictures came late, by up to {load.lateness_s:.2f} s"
        )
    if load.paused_s:
        parts.append(f"the emulated rig stood still for {load.paused_s:.2f} s")
    return "; ".join(parts)


def _waited(who: str, wait: Wait, load: MachineLoad) -> str:
    longest = f" ({wait.longest})" if wait.longest else ""
    return f"{who} waited {wait.waited_s:.1f} s of {load.duration_s:.1f} s for a processor{longest}"


FILE_NAME = "history.json"
Past = Mapping[str, Sequence[Mapping[str, Any]]]
"""Runs by a test's slug, the latest last: each ``when`` (s since the epoch), ``outcome`` and values of ``checks``."""
_WIDTH, _HEIGHT, _EDGE = 64, 20, 3


def write_history(folder: Path, past: Past) -> None:
    """Writes what the checks of a report's tests measured in the latest runs; raises OSError."""
    atomic.write_text(folder / FILE_NAME, json.dumps(past, separators=(",", ":"), allow_nan=False) + "\n")


def read_history(folder: Path) -> Past:
    """What ``write`` wrote into a report's folder; empty where there is nothing."""
    try:
        past = json.loads(regular_file.text(folder / FILE_NAME))
    except (OSError, ValueError, RecursionError):
        return {}
    return past if isinstance(past, dict) else {}


def curve(past: Past, slug: str, check: Mapping[str, Any]) -> Markup:
    """A check's values as a picture; empty with fewer than two of them, and for what is not a history."""
    try:
        values = [float(run["checks"][check["name"]]) for run in past.get(slug, ()) if check["name"] in run["checks"]]
        limits = [float(limit) for limit in (check.get("limit") or {}).values()]
    except (TypeError, KeyError, ValueError, AttributeError):
        return Markup()
    if len(values) < 2 or not all(map(math.isfinite, values)):
        return Markup()
    return _svg(values, limits)


def _svg(values: Sequence[float], limits: Sequence[float]) -> Markup:
    low, high = min(values), max(values)
    near = [limit for limit in limits if low - (high - low) <= limit <= high + (high - low)]
    low, high = min([low, *near]), max([high, *near])

    def y(value: float) -> int:
        share = (value - low) / (high - low) if high > low else 0.5
        return round(_HEIGHT - _EDGE - share * (_HEIGHT - 2 * _EDGE))

    step = (_WIDTH - 2 * _EDGE) / (len(values) - 1)
    points = [(round(_EDGE + n * step), y(value)) for n, value in enumerate(values)]
    lines = "".join(f'<line x1="0" x2="{_WIDTH}" y1="{y(limit)}" y2="{y(limit)}"/>' for limit in near)
    curve_ = " ".join(f"{px},{py}" for px, py in _corners(points))
    (px, py), text = points[-1], f"last {len(values)} values: {min(values):.4g} to {max(values):.4g}"
    return Markup(  # noqa: S704  (only numbers are in it)
        f'<svg class="curve" role="img" viewBox="0 0 {_WIDTH} {_HEIGHT}"><title>{text}</title>'
        f'{lines}<polyline points="{curve_}"/><circle cx="{px}" cy="{py}" r="2"/></svg>'
    )


def _corners(points: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Without those on level stretches between two of the same height: pages with many tests have thousands."""
    inner = zip(points, points[1:], points[2:], strict=False)
    return [points[0], *(now for before, now, after in inner if not before[1] == now[1] == after[1]), points[-1]]


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
    past: Past = field(default_factory=dict)


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
            curve=curve,
            grids=grids(outcomes),
            worst={worst.test: worst for worst in worst_instances(outcomes)},
            decisive_value=decisive_value,
            comparison=comparison,
            changed=comparison.by_slug() if comparison else {},
            words=report_comparison,
            check_words=report_comparison,
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
    """Renders pages of untrusted texts."""
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
