"""What the checks of a report's tests measured in the latest runs: kept beside the report, drawn as small curves."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file

FILE_NAME = "history.json"
Past = Mapping[str, Sequence[Mapping[str, Any]]]
"""Runs by a test's slug, the latest last: each ``when`` (s since the epoch), ``outcome`` and values of ``checks``."""
_WIDTH, _HEIGHT, _EDGE = 64, 20, 3


def write(folder: Path, past: Past) -> None:
    """The runs of a report's tests; raises OSError."""
    atomic.write_text(folder / FILE_NAME, json.dumps(past, separators=(",", ":"), allow_nan=False) + "\n")


def read(folder: Path) -> Past:
    """The same; empty where there are none."""
    try:
        past = json.loads(regular_file.text(folder / FILE_NAME))
    except (OSError, ValueError, RecursionError):
        return {}
    return past if isinstance(past, dict) else {}


def curve(past: Past, slug: str, check: Mapping[str, Any]) -> Markup:
    """A check's values as a picture; empty with fewer than two of them, and for what is no history."""
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
