"""Set-up and execution of tests as a PNG, as in Figure 5.3 of the thesis."""

import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path

Times = tuple[float, float]
"""Seconds of set-up and of execution."""

_PIXELS_PER_INCH = 110
_MOST = 60


def draw(tests: Mapping[str, Sequence[Times]], machine: str, target: Path) -> None:
    """One bar for each test with the median of its runs on this machine, each run as a point; the longest on top."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = sorted(tests, key=lambda name: sum(_median(tests[name])))[-_MOST:]
    figure = Figure(figsize=(8, 1.3 + 0.32 * len(names)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    setups, executions = ([_median(tests[name])[part] for name in names] for part in (0, 1))
    axes.barh(names, setups, height=0.6, color="#8c959f", label="set-up")
    axes.barh(names, executions, left=setups, height=0.6, color="#1f6feb", label="execution")
    points = [(sum(run), row) for row, name in enumerate(names) for run in tests[name]]
    axes.scatter([x for x, _ in points], [y for _, y in points], s=7, color="0.15", zorder=3, label="a run")
    axes.set_xlabel("s")
    axes.set_title(f"Set-up and execution on {machine}, {len(points)} runs".replace("$", r"\$"), fontsize=10)
    axes.legend(fontsize=8, loc="lower right")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(target, dpi=_PIXELS_PER_INCH, format="png")


def _median(runs: Sequence[Times]) -> Times:
    return statistics.median(run[0] for run in runs), statistics.median(run[1] for run in runs)
