"""The result of a tuning: as JSON, as an ``.env`` file and as a table."""

import itertools
from collections.abc import Iterator
from typing import Any

from dodo_dsl.cli.tune.course import TuneCourse
from dodo_dsl.search.space import texts
from dodo_dsl.terminal import printable


def document(course: TuneCourse) -> dict[str, Any]:
    """Of a course that judged the defaults. ``progress`` has the values in the order in which they were driven."""
    first, best = course.done[0], course.best
    bests = itertools.accumulate((one.margin for one in course.done), max)
    held_out = course.study.held_out
    return {
        "objective": "mean" if course.mean else "worst",
        "seed": course.itinerary.seed,
        "scenarios": [one.name for one in course.study.scenarios],
        "default": {"values": texts(first.values), "margin": first.margin},
        "best": {"values": texts(best.values), "margin": best.margin},
        "progress": [
            {"values": texts(one.values), "margin": one.margin, "best": margin}
            for one, margin in zip(course.done, bests, strict=True)
        ],
        "finals": {
            "scenarios": [one.name for one in course.study.deciding],
            "values": [{"values": texts(one.values), "margin": one.margin} for one in course.finals],
        },
        "held_out": {
            "scenarios": [one.name for one in held_out],
            "default": [course.margin(first.values, [one]) for one in held_out],
            "best": [course.margin(best.values, [one]) for one in held_out],
        },
    }


def env(course: TuneCourse) -> str:
    return "".join(f"{name}={text}\n" for name, text in texts(course.best.values).items())


def table(course: TuneCourse) -> Iterator[str]:
    first, best = course.done[0], course.best
    held_out = course.study.held_out
    rows = [("", "default", "best", "range")]
    for one in course.study.space.ranges:
        rows.append((one.name, first.values[one.name].text, best.values[one.name].text, one.text))
    rows.append((f"{'mean' if course.mean else 'worst'} margin", f"{first.margin:.3f}", f"{best.margin:.3f}", ""))
    if course.finals:
        chosen = max(one.margin for one in course.finals)
        said = f"chosen among the best {len(course.finals)} with {len(course.study.deciding)} more samples"
        rows.append(("of the finals", "", f"{chosen:.3f}", said))
    if held_out:
        before, after = (_shown(course.margin(one.values, held_out)) for one in (first, best))
        rows.append(("held out", before, after, f"{len(held_out)} samples that did not guide the tuning"))
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    yield ""
    for row in rows:
        cells = [row[0].ljust(widths[0]), row[1].rjust(widths[1]), row[2].rjust(widths[2]), row[3]]
        yield printable("  ".join(cells).rstrip())
    if best is first:
        yield "no values are better than the defaults"


def _shown(margin: float | None) -> str:
    return "unknown" if margin is None else f"{margin:.3f}"
