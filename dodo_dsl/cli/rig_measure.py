"""dodo rig measure: the constants of a rig's axes, by the true positions that the person at the rig reads."""

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import Any, TextIO

import numpy as np

from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.cli.numbers import patience
from dodo_dsl.run.protocol import Say
from dodo_dsl.run.rigs.access import MANUAL, flags, occupied
from dodo_dsl.run.rigs.leases import devices_in
from dodo_dsl.spec import quantity
from dodo_dsl.spec.manifest import load_manifests
from dodo_dsl.spec.rig import CIRCLE, Rig
from dodo_dsl.terminal import printable

UNITS, TOLERANCES, DECIMALS = {"x": "m", "y": "m", "yaw": "deg"}, {"m": 0.001, "deg": 0.5}, {"m": 2, "deg": 0}
PLACES = 5
SHARE = 0.8
"""Of each range that is measured: the constants may be wrong by up to 10 % and 10 cm before."""
ANY_HEADING = (-150.0, 150.0)
"""degrees, of a yaw without bounds."""
CIRCLE_STEPS = 200 / 360
"""Full steps a degree of a yaw that turns without end, of which only the offset is measured."""
SUMMARY = "measure the constants of its axes, to be written into dodo.yml"
EXAMPLES = """examples:
  dodo rig measure kiwi-dynamic         it moves to 5 positions of each axis, and asks for the true ones
  dodo rig measure kiwi-dynamic --axes yaw

Readings may be 1 mm, or 0.5 degrees of the yaw, off their line; otherwise the exit code is 1.
"""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="name of a rig in dodo.yml")
    parser.add_argument("--axes", metavar="A,B", default="x,y,yaw", help="axes to measure (default: x,y,yaw)")
    wait = "maximum wait for a busy rig, in s (default: 60)"
    parser.add_argument("--wait", type=patience, default=60.0, metavar="S", help=wait)


def measure(options: argparse.Namespace, rig: Rig, stdout: TextIO, stderr: TextIO) -> int:
    """Measures, and prints what to write; the exit code. Raises UsageError, RigProblem and LeaseTimeout."""
    axes = [name for name in options.axes.split(",") if name]
    if strange := [name for name in axes if name not in UNITS]:
        raise UsageError(f"--axes: there is no axis '{strange[0]}', expected some of {', '.join(UNITS)}")
    if rig.entry("serial") is None:
        raise UsageError(f"rig '{rig.name}' has no serial port, so it cannot move")
    words, found = flags(rig), list[str]()

    def say(text: str) -> None:
        stderr.write(printable(text))
        stderr.flush()

    def waits(text: str) -> None:
        say(f"{text}\n")

    with occupied(rig.cid, "'dodo rig measure'", devices_in(words), waits, options.wait) as query:

        def move(*action: str) -> dict[str, Any]:
            return query((MANUAL, [*words, *action]))

        _ask(f"rig '{rig.name}' finds its home first: clear its workspace, and press Enter ", say)
        reach = move("calibrate")["reach"]
        for axis in axes:
            unit, is_circle = UNITS[axis], axis == "yaw" and rig.kind == CIRCLE
            goals = _goals(reach[axis] or ANY_HEADING, DECIMALS[unit])
            readings = [_reading(axis, goal, move, say) for goal in goals]
            density, offset, residuals = line([each[0] for each in readings], [each[1] for each in readings], is_circle)
            if problem := _problem(axis, density, offset, residuals):
                say(f"dodo rig measure: {problem}\n")
                return Exit.PROBLEMS
            constants = "" if is_circle else f"steps: {density:.7g} steps/{unit}, "
            found.append(f"{axis}: {{{constants}offset: {offset:.4f} steps}}")
    stdout.write(f"write into dodo.yml, under rigs, {rig.name}:\n  axes: {{{', '.join(found)}}}\n")
    stdout.write(f"then 'dodo rig calibrate {rig.name}' gives the rig its limits by these constants\n")
    return Exit.OK


def _ask(prompt: str, say: Say) -> str:
    """The answer to a prompt; raises UsageError at the end of standard input."""
    say(prompt)
    if not (line := sys.stdin.readline()):
        raise UsageError("standard input ended before all was measured")
    return line.strip()


def _reading(axis: str, goal: float, move: Callable[..., dict[str, Any]], say: Say) -> tuple[float, float]:
    """The counter's full steps from home at a goal, and the true position there (m, degrees)."""
    unit = UNITS[axis]
    answer = move("goto", *(f"{goal if name == axis else 0:g}" for name in UNITS))
    stands = f"{axis}: the rig stands at {answer[axis]:.4f} {unit} by its counters"
    while True:
        text = _ask(f"{stands}. Its true position, such as {goal:g} {unit}: ", say)
        try:
            return answer["steps"][axis], float(quantity.convert(text, unit))
        except quantity.QuantityError as error:
            say(f"{error}; {error.hint}\n" if error.hint else f"{error}\n")


def _goals(limits: Sequence[float], decimals: int) -> list[float]:
    low, high = limits
    middle, half = (low + high) / 2, SHARE * (high - low) / 2
    return [round(float(goal), decimals) for goal in np.linspace(middle - half, middle + half, PLACES)]


def line(steps: Sequence[float], places: Sequence[float], is_circle: bool = False) -> tuple[float, float, Any]:
    """Density and offset of steps = density * place + offset by least squares, and what each place is off it.

    Of a circle the offset alone; a heading may have any of its names.
    """
    counted, read = np.array(steps), np.array(places)
    if is_circle:
        shifts = read - counted / CIRCLE_STEPS
        apart = (shifts - shifts[0] + 180) % 360 - 180
        offset = -(shifts[0] + apart.mean()) * CIRCLE_STEPS % (360 * CIRCLE_STEPS)
        return CIRCLE_STEPS, float(offset), apart - apart.mean()
    slope, level = np.polyfit(counted, read, 1)
    return float(1 / slope), float(-level / slope), read - slope * counted - level


def _problem(axis: str, density: float, offset: float, residuals: Any) -> str:
    """Why a line is none that the gantry takes; empty if it is."""
    unit, worst = UNITS[axis], int(np.abs(residuals).argmax())
    if not abs(residuals[worst]) <= TOLERANCES[unit]:
        off = f"reading {worst + 1} is {residuals[worst]:+.4f} {unit} off the line of all"
        return f"{axis}: {off}, and {TOLERANCES[unit]:g} {unit} are allowed"
    known = load_manifests()[0]["gantry"].parameters
    for what, number in {"steps": density, "offset": offset}.items():
        about = known[f"{what}-{axis}"]
        assert about.minimum is not None and about.maximum is not None
        if not about.minimum <= number <= about.maximum:
            text = f"{axis}: {what} is {number:.6g} {about.unit}, expected {about.minimum:g} to {about.maximum:g}"
            return f"{text}: are units, signs and the middle of the readings right?"
    return ""
