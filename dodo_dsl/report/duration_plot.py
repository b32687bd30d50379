"""Set-up and execution of tests as an SVG, as in Figure 5.3 of the thesis.

Every run ends with it, so that it must cost little: a plotting library takes a second to load.
"""

import math
import statistics
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from dodo_dsl.report.overview import environment

Times = tuple[float, float]
"""Seconds of set-up and of execution."""

_MOST = 60
_WIDTH, _LEFT, _RIGHT, _TOP, _ROW = 880, 260, 20, 48, 26
"""Pixels: of the picture, left and right of the bars, above them, and of one test."""
_LONGEST = 38
"""Letters of a name that find room."""
_INTERVALS = 8


class Tick(NamedTuple):
    """A label of the axis at ``x`` pixels."""

    x: float
    text: str


class Bar(NamedTuple):
    """A test: its place, the lengths of its bars and the places of its runs in pixels, and its times in words."""

    name: str
    y: int
    setup: float
    execution: float
    runs: list[float]
    text: str


def draw(tests: Mapping[str, Sequence[Times]], machine: str) -> str:
    """One bar for each test with the median of its runs on this machine, each run as a point; the longest on top."""
    names = sorted(tests, key=lambda name: sum(_median(tests[name])), reverse=True)[:_MOST]
    longest = max(sum(run) for name in names for run in tests[name])
    step = round_step(max(longest, 0.001) / _INTERVALS)
    scale = (_WIDTH - _LEFT - _RIGHT) / max(longest, step)
    bottom = _TOP + _ROW * len(names)
    return (
        environment()
        .get_template("times.svg.j2")
        .render(
            width=_WIDTH,
            height=bottom + 28,
            left=_LEFT,
            top=_TOP - 4,
            bottom=bottom,
            machine=machine,
            runs=sum(len(tests[name]) for name in names),
            ticks=[
                Tick(round(_LEFT + n * step * scale, 1), f"{n * step:g} s")
                for n in range(math.floor(longest / step) + 1)
            ],
            rows=[_row(number, name, tests[name], scale) for number, name in enumerate(names)],
        )
    )


def _row(number: int, name: str, runs: Sequence[Times], scale: float) -> Bar:
    setup, execution = _median(runs)
    shown = name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…"
    places = [round(_LEFT + sum(run) * scale, 1) for run in runs]
    text = f"{name}: set-up {setup:.2f} s, execution {execution:.2f} s"
    return Bar(shown, _TOP + _ROW * number, round(setup * scale, 1), round(execution * scale, 1), places, text)


def round_step(least: float) -> float:
    """The step of an axis that is at least so large: 1, 2 or 5 times a power of ten."""
    power: float = 10.0 ** math.floor(math.log10(least))
    return next(power * factor for factor in (1, 2, 5, 10) if power * factor >= least)


def _median(runs: Sequence[Times]) -> Times:
    return statistics.median(run[0] for run in runs), statistics.median(run[1] for run in runs)
