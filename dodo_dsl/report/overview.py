"""``index.html``: the run at a glance, in one file: what failed comes first, and each row leads to its drive.

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
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup, escape

from dodo_dsl import __version__, atomic, package_data
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import MachineLoad, Outcome, Wait, megabytes, worst_margin
from dodo_dsl.report import checks
from dodo_dsl.report.comparison import KINDS, Comparison
from dodo_dsl.report.instances import MatrixGrid, compared, grids
from dodo_dsl.report.results import NO_CIRCUMSTANCES, Circumstances


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
    """What ``write`` wrote into a report's folder; empty if there is nothing."""
    try:
        past = json.loads(regular_file.text(folder / FILE_NAME))
    except (OSError, ValueError, RecursionError):
        return {}
    return past if isinstance(past, dict) else {}


def curve(past: Past, slug: str, check: Mapping[str, Any]) -> Markup:
    """A check's values as a picture; empty without two different ones, and for what is not a history."""
    try:
        values = [float(run["checks"][check["name"]]) for run in past.get(slug, ()) if check["name"] in run["checks"]]
        limits = [float(limit) for limit in (check.get("limit") or {}).values()]
    except (TypeError, KeyError, ValueError, AttributeError):
        return Markup()
    if len(set(values)) < 2 or not all(map(math.isfinite, values)):
        return Markup()
    return _svg(values, limits)


def history(past: Past, slug: str, checks: Sequence[Mapping[str, Any]]) -> list[tuple[Mapping[str, Any], Markup]]:
    """The curves of those checks of a test that have a limit and did not have the same value each time."""
    drawn = ((check, curve(past, slug, check)) for check in checks if check.get("limit"))
    return [(check, picture) for check, picture in drawn if picture]


def _svg(values: Sequence[float], limits: Sequence[float]) -> Markup:
    low, high = min(values), max(values)
    near = [limit for limit in limits if low - (high - low) <= limit <= high + (high - low)]
    low, high = min([low, *near]), max([high, *near])

    def y(value: float) -> int:
        return round(_HEIGHT - _EDGE - (value - low) / (high - low) * (_HEIGHT - 2 * _EDGE))

    step = (_WIDTH - 2 * _EDGE) / (len(values) - 1)
    points = [(round(_EDGE + n * step), y(value)) for n, value in enumerate(values)]
    lines = "".join(f'<line x1="0" x2="{_WIDTH}" y1="{y(limit)}" y2="{y(limit)}"/>' for limit in near)
    curve_ = " ".join(f"{px},{py}" for px, py in points)
    (px, py), text = (
        points[-1],
        f"last {len(values)} values: {checks.number(min(values))} to {checks.number(max(values))}",
    )
    return Markup(  # noqa: S704  (only numbers are in it)
        f'<svg class="curve" role="img" viewBox="0 0 {_WIDTH} {_HEIGHT}"><title>{text}</title>'
        f'{lines}<polyline points="{curve_}"/><circle cx="{px}" cy="{py}" r="2"/></svg>'
    )


class LinkedFiles(NamedTuple):
    """What a report has of a test: paths relative to its page, empty if there is none, and what each picture shows."""

    pictures: Sequence[tuple[str, str]] = ()
    logs: Sequence[str] = ()
    recording: str = ""
    spec: str = ""
    drive: str = ""


@dataclass(frozen=True)
class Row:
    """A test, or all instances of a matrix with its ``grid``."""

    outcomes: Sequence[Outcome]
    grid: MatrixGrid | None = None

    @property
    def urgency(self) -> int:
        return min(map(urgency, self.outcomes))

    def count(self, kind: str) -> int:
        """How many of its tests have an outcome."""
        return sum(o.outcome == kind for o in self.outcomes)


_URGENCIES = ("failed", "error", "passed")


def urgency(outcome: Outcome) -> int:
    """0 for what is looked at first."""
    return _URGENCIES.index(outcome.outcome)


def rows(outcomes: Sequence[Outcome]) -> list[Row]:
    """What did not pass first, else in the order of the outcomes; instances of a matrix are one row."""
    of = {id(o): grid for grid in grids(outcomes) for row in grid.rows for cell in row.cells for o in cell}
    found: dict[int, tuple[MatrixGrid | None, list[Outcome]]] = {}
    for outcome in outcomes:
        grid = of.get(id(outcome))
        found.setdefault(id(grid or outcome), (grid, []))[1].append(outcome)
    return sorted((Row(sorted(each, key=urgency), grid) for grid, each in found.values()), key=lambda row: row.urgency)


_BREAKS = re.compile(r"(?=\[)|(?<=,)")
_INDENT = re.compile(r"\n +(?=<)")
"""Of tags: text of others has none, and a page with many tests has thousands."""
_UNITS = re.compile(r"(?<=\d) (?=\S)")
_MOST_TEXT = 10_000
"""Characters of one text of others on the page."""
_MOST_REPOSITORIES = 4
_MOST_OF_A_LINE = 56
"""Characters of the reason of a test that passed, which has one line."""


def render(
    outcomes: Sequence[Outcome],
    files: Mapping[str, LinkedFiles],
    past: Past,
    comparison: Comparison | None = None,
    circumstances: Circumstances = NO_CIRCUMSTANCES,
) -> str:
    """The page, with files by slug and earlier values of checks; with a comparison, what changed since that report."""
    counts = {kind: sum(o.outcome == kind for o in outcomes) for kind in ("passed", "failed", "error")}
    repositories = {r.commit: r for run in circumstances.runs for r in run.repositories}
    script = (package_data.templates() / "report" / "suite.js").read_text(encoding="utf-8")
    page = (
        environment()
        .get_template("report.html.j2")
        .render(
            outcomes=outcomes,
            rows=rows(outcomes),
            files=files,
            past=past,
            checks=checks,
            longest=_MOST_OF_A_LINE,
            repositories=list(repositories.values())[:_MOST_REPOSITORIES],
            taken_s=sum((o.setup_s or 0.0) + (o.execution_s or 0.0) for o in outcomes),
            counts=counts,
            not_run=circumstances.not_run,
            runs=circumstances.runs,
            version=__version__,
            machine_line=machine_line,
            megabytes=megabytes,
            history=history,
            compared={one.test: one for one in compared(outcomes)},
            margin=worst_margin,
            comparison=comparison,
            changed=comparison.by_slug() if comparison else {},
            kinds=KINDS,
            script=script,
            style=style(),
            hash=source_hash,
            breakable=breakable,
            unbroken=unbroken,
        )
    )
    return _INDENT.sub("\n", page)


def style() -> str:
    """The style sheet of pages, which begins with what the drive viewer has in common with them."""
    parts = ("viewer/tokens.css", "report/suite.css")
    return "".join((package_data.templates() / part).read_text(encoding="utf-8") for part in parts)


@functools.cache
def environment() -> jinja2.Environment:
    """Renders pages of untrusted texts."""
    return jinja2.Environment(
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
    return Markup(_UNITS.sub("\u00a0", escape(_harmless(text))))  # noqa: S704  (escaped)


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
