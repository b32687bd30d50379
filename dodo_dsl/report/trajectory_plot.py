"""A drive from above as a PNG."""

from pathlib import Path
from typing import Any

from dodo_dsl.outcome import Outcome
from dodo_dsl.report.trajectory import Drive
from dodo_dsl.terminal import printable

_COLOURS = {"passed": "#1a7f37", "failed": "#cf222e", "error": "#9a6700"}
_SNAPSHOT_S = 1.0
_MARGIN = 0.3
_PIXELS_PER_INCH = 110
_INCHES = 7.0
_AROUND_INCHES = 1.4
"""Room for title, labels and legend."""


def draw(drive: Drive, outcome: Outcome, target: Path) -> None:
    """Cones, walls and goal, the path and the vehicle's rectangle each second and at the end."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    _ground(axes, drive)
    colour = _COLOURS[outcome.outcome]
    axes.plot([p[0] for p in drive.path], [p[1] for p in drive.path], color=colour, linewidth=1.6, label="path")
    _vehicles(axes, drive, colour)
    _frame(axes, drive)
    reason = printable(outcome.reason).replace("$", r"\$")  # it is not a formula
    axes.set_title(f"{outcome.name}: {outcome.outcome}\n{reason}", fontsize=10, wrap=True)
    figure.savefig(target, dpi=_PIXELS_PER_INCH, format="png")


def _ground(axes: Any, drive: Drive) -> None:
    for colour, points in drive.ground.models:
        axes.scatter(
            [p[0] for p in points],
            [p[1] for p in points],
            s=16,
            color=colour,
            edgecolors="0.3",
            linewidths=0.5,
        )
    for name, lines in drive.ground.lines:
        is_goal = name == drive.goal
        for index, (x1, y1, x2, y2) in enumerate(lines):
            axes.plot(
                [x1, x2],
                [y1, y2],
                color="#1f6feb" if is_goal else "0.6",
                linewidth=2.0 if is_goal else 1.0,
                linestyle="-" if is_goal else "--",
                label=name if is_goal and index == 0 else None,
            )


def _vehicles(axes: Any, drive: Drive, colour: str) -> None:
    if not (drive.length and drive.width):
        return
    from matplotlib.patches import Rectangle
    from matplotlib.transforms import Affine2D

    due = 0.0
    last = len(drive.path) - 1
    for index, (x, y, heading, when) in enumerate(drive.path):
        if when < due and index != last:
            continue
        due = when - when % _SNAPSHOT_S + _SNAPSHOT_S
        box = Rectangle(
            (-drive.length / 2, -drive.width / 2),
            drive.length,
            drive.width,
            fill=index == last,
            alpha=0.7 if index == last else 0.9,
            facecolor=colour,
            edgecolor=colour,
            linewidth=0.8,
        )
        box.set_transform(Affine2D().rotate(heading).translate(x, y) + axes.transData)
        axes.add_patch(box)


def _frame(axes: Any, drive: Drive) -> None:
    """Equal axes around path and lines; far cones may fall outside."""
    points = [(p[0], p[1]) for p in drive.path]
    points += [(x, y) for _, lines in drive.ground.lines for a, b, c, d in lines for x, y in ((a, b), (c, d))]
    xs, ys = [p[0] for p in points], [p[1] for p in points]
    axes.set_xlim(min(xs) - _MARGIN, max(xs) + _MARGIN)
    axes.set_ylim(min(ys) - _MARGIN, max(ys) + _MARGIN)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.grid(True, linewidth=0.3)
    axes.figure.legend(loc="outside lower center", ncols=2, fontsize=8, frameon=False)
    wide, high = max(xs) - min(xs) + 2 * _MARGIN, max(ys) - min(ys) + 2 * _MARGIN
    axes.figure.set_size_inches(_INCHES, min(_INCHES, _INCHES * high / wide + _AROUND_INCHES))
