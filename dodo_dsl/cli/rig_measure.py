"""dodo rig measure: the constants of a rig's axes, or of its camera, measured and written into dodo.yml.

Axes: the rig moves to places, and the person at the rig reads where it truly is.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.cli.numbers import patience, positive
from dodo_dsl.run.rigs import access, rig_entry
from dodo_dsl.run.rigs import axis_calibration as written_readings
from dodo_dsl.run.rigs.access import MANUAL, occupied
from dodo_dsl.run.rigs.axis_calibration import (
    AXES,
    CIRCLE_YAW,
    FEWEST,
    Axis,
    AxisLine,
    CalibrationProblem,
    Reading,
    ReadingOff,
    Readings,
    ReadingsError,
    fit,
    place,
)
from dodo_dsl.run.rigs.leases import devices_in
from dodo_dsl.run.rigs.permission import refuse_forbidden
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import load_manifests
from dodo_dsl.spec.rig import CIRCLE, Rig
from dodo_dsl.terminal import json_text, printable

SHARE = 0.8
"""Of each range that is measured: the constants may be wrong by up to 10 % and 10 cm before."""
RETAKES = 2
ANY_HEADING = (-150.0, 150.0)
"""degrees, of a yaw without bounds."""
_DECIMALS = {"m": 2, "deg": 0}


@dataclass(frozen=True)
class AxisSession:
    """``move`` gives the answer of the gantry's program to an action, ``ask`` that of a person to a prompt.

    Whatever was read is in ``readings``, also after an error.
    """

    move: Callable[[Sequence[str]], dict[str, Any]]
    ask: Callable[[str], str]
    say: Callable[[str], None]
    count: int
    readings: Readings

    def home(self, name: str) -> dict[str, Any]:
        """Lets the rig find its home, after somebody permitted it; the places within its reach."""
        self.ask(f"rig '{name}' finds its home first: clear its workspace, and press Enter ")
        reach: dict[str, Any] = self.move(["calibrate"])["reach"]
        return reach

    def measure(self, axis: Axis, limits: Sequence[float] | None) -> AxisLine:
        """Reads as many places of an axis as are wanted; one that the others contradict is read again."""
        goals = _goals(limits or ANY_HEADING, self.count, _DECIMALS[axis.unit])
        readings = self.readings[axis.name] = []
        readings.extend(self._read(axis, goal, f"{number} of {len(goals)}") for number, goal in enumerate(goals, 1))
        for _ in range(RETAKES):
            try:
                return fit(axis, readings)
            except ReadingOff as off:
                if off.index is None:
                    raise
                self.say(f"{off}; it is read again")
                readings[off.index] = self._read(axis, goals[off.index], "again")
        return fit(axis, readings)

    def _read(self, axis: Axis, goal: float, which: str) -> Reading:
        place_of = {"x": 0.0, "y": 0.0, "yaw": 0.0, axis.name: goal}
        answer = self.move(["goto", *(f"{value:g}" for value in place_of.values())])
        counted = f"the rig stands at {axis.shown(answer[axis.name])} by its counters"
        prompt = f"{axis.name}, {which}: {counted}. Its true place, such as {axis.shown(goal)}: "
        while True:
            try:
                return Reading(answer["steps"][axis.name], place(axis, self.ask(prompt)))
            except ReadingsError as error:
                self.say(str(error))


def _goals(limits: Sequence[float], count: int, decimals: int) -> list[float]:
    low, high = limits
    middle, half = (low + high) / 2, SHARE * (high - low) / 2
    return [round(middle - half + 2 * half * index / (count - 1), decimals) for index in range(count)]


def asker(stderr: TextIO) -> Callable[[str], str]:
    """Asks a person with a prompt for a line; it raises UsageError at the end of standard input."""

    def ask(prompt: str) -> str:
        stderr.write(printable(prompt))
        stderr.flush()
        line = sys.stdin.readline()
        if not line:
            stderr.write("\n")
            raise UsageError("standard input ended; --readings FILE, --reading or --pictures FOLDER needs no answers")
        return line.strip()

    return ask


SUMMARY = "measure the constants of its axes, or its camera, and write them into dodo.yml"
EXAMPLES = """examples:
  dodo rig measure kiwi-dynamic         it moves to 5 positions of each axis, and asks for the true ones
  dodo rig measure kiwi-dynamic --axes yaw --places 9
  dodo rig measure kiwi-dynamic --readings desk.yml --dry-run
                                        compute from readings of a file; nothing moves
  dodo rig measure kiwi-dynamic --reading x:614.1:-715mm --reading x:1842.5:-345mm \\
      --reading x:3071:25mm --reading x:4299.3:395mm
  dodo rig measure kiwi-dynamic --camera
                                        its camera's optics, with the board of `dodo rig board`
  dodo rig measure kiwi-dynamic --pictures snapshots
                                        the same from existing images

A file of readings has the counters' steps, as `dodo rig goto --json` prints them, and the position that was read:
  x: [{steps: 614.1 steps, reads: -715 mm}, {steps: 1842.5 steps, reads: -345 mm}, ...]

A residual may be 1 mm, or 0.5 degrees of the yaw; otherwise nothing is written, and the exit code is 1.
"""
OFFSETS = (72.0, 94.0), (89.0, 111.0)
"""Full steps that a yaw's offset may have: of a rig of the kind dynamic, and circle."""
_DIGITS = {"x": 4, "y": 4, "yaw": 7}


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="name of a rig in dodo.yml")
    parser.add_argument(
        "--axes", metavar="A,B", default="", help="axes to measure (default: x,y,yaw, or those of the readings)"
    )
    parser.add_argument("--places", type=positive, default=5, metavar="N", help="positions of each axis (default: 5)")
    parser.add_argument("--reading", action="append", default=[], metavar="AXIS:STEPS:PLACE",
                        help="a reading instead of motion, such as x:614.1:-715mm; repeatable")  # fmt: skip
    parser.add_argument("--readings", type=Path, metavar="FILE", help="file of readings instead of motion")
    parser.add_argument("--camera", action="store_true", help="measure its camera instead, with images of the board")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="images of the board instead of its camera's")
    parser.add_argument("--dry-run", action="store_true", help="write nothing")
    wait = "maximum wait for a busy rig, in s (default: 60)"
    parser.add_argument("--wait", type=patience, default=60.0, metavar="S", help=wait)
    parser.add_argument("--json", action="store_true", help="output as JSON")


def measure(options: argparse.Namespace, deployment: Deployment, rig: Rig, stdout: TextIO, stderr: TextIO) -> int:
    """Measures and writes; the exit code. Raises UsageError, RigProblem and LeaseTimeout."""
    if rig.is_emulated:
        raise UsageError("the emulated rig is as its firmware has it, and has no entry in dodo.yml to write")
    if options.camera or options.pictures:
        from dodo_dsl.cli import rig_camera  # OpenCV takes a second to import

        return rig_camera.measure_camera(options, deployment, rig, stdout, stderr)
    known = AXES | ({"yaw": CIRCLE_YAW} if rig.kind == CIRCLE else {})
    axes = _axes(options.axes, known)
    found: Readings = {}
    try:
        lines = _lines(options, deployment, rig, axes or list(known.values()), found, stderr)
        _refuse_implausible(deployment, rig, lines)
        values = _values(rig, lines)
        file = _written(options, deployment, rig, values)
    except CalibrationProblem as problem:
        stderr.write(f"dodo rig measure: {printable(str(problem))}\n")
        if any(found.values()) and not getattr(problem, "usage", False):
            stderr.write(f"nothing is written; the readings:\n{written_readings.as_text(found)}")
        return Exit.USAGE if getattr(problem, "usage", False) else Exit.PROBLEMS
    except (UsageError, RigProblem, KeyboardInterrupt):
        if any(found.values()):
            stderr.write(f"\nnothing is written; the readings until then:\n{written_readings.as_text(found)}")
        raise
    stdout.write(_json(rig, lines, found, file) if options.json else _text(rig, lines, found, file))
    return Exit.OK


def _axes(text: str, known: dict[str, Axis]) -> list[Axis]:
    names = [name for name in text.split(",") if name]
    for name in names:
        if name not in AXES:
            raise UsageError(f"--axes: there is no axis '{name}', expected some of {', '.join(AXES)}")
    return [axis for axis in known.values() if axis.name in names]


def _lines(
    options: argparse.Namespace,
    deployment: Deployment,
    rig: Rig,
    axes: Sequence[Axis],
    found: Readings,
    stderr: TextIO,
) -> dict[str, AxisLine]:
    """The lines of the axes, whose readings go to ``found``."""
    if options.reading or options.readings:
        if options.readings:
            found.update(written_readings.of_file(options.readings))
        for name, reading in map(written_readings.of_flag, options.reading):
            found.setdefault(name, []).append(reading)
        chosen = [axis for axis in axes if options.axes or axis.name in found]
        return {axis.name: fit(axis, found.get(axis.name, [])) for axis in chosen}
    if options.places < FEWEST:
        raise UsageError(f"--places is {options.places}, expected at least {FEWEST}")
    if rig.entry("serial") is None:
        raise UsageError(f"rig '{rig.name}' has no serial port, so it cannot move")
    flags = access.flags(rig)
    devices = [text for key in ("serial", "camera.source") if (text := rig.text(key))]
    refuse_forbidden(devices, access.motion(rig), [deployment.root])

    def say(text: str) -> None:
        stderr.write(f"{printable(text)}\n")

    with occupied(rig.cid, "'dodo rig measure'", devices_in(flags), say, options.wait) as query:
        session = AxisSession(
            lambda words: query((MANUAL, [*flags, *words])), asker(stderr), say, options.places, found
        )
        limits = session.home(rig.name)
        return {axis.name: session.measure(axis, limits[axis.name]) for axis in axes}


def _refuse_implausible(deployment: Deployment, rig: Rig, lines: dict[str, AxisLine]) -> None:
    """The gantry takes no constants that are far from the firmware's."""
    known = load_manifests(deployment.services)[0]["gantry"].parameters
    circle = rig.kind == CIRCLE
    for name, line in lines.items():
        values = {"offset": line.offset} if circle and name == "yaw" else {"steps": line.steps, "offset": line.offset}
        for what, value in values.items():
            about = known[f"{what}-{name}"]
            low, high = OFFSETS[circle] if (name, what) == ("yaw", "offset") else (about.minimum, about.maximum)
            assert low is not None and high is not None
            if not low <= value <= high:
                text = f"{name}: {what} is {value:.6g} {about.unit}, expected {low:g} to {high:g}"
                raise CalibrationProblem(f"{text}: are units, signs and the middle of the readings right?")


def _values(rig: Rig, lines: dict[str, AxisLine]) -> dict[tuple[str, ...], str]:
    values: dict[tuple[str, ...], str] = {}
    for name, line in lines.items():
        if rig.kind != CIRCLE or name != "yaw":
            values["axes", name, "steps"] = f"{line.steps:.{_DIGITS[name]}f} {AXES[name].density}"
        values["axes", name, "offset"] = f"{line.offset:.4f} steps"
    return values


def _written(
    options: argparse.Namespace, deployment: Deployment, rig: Rig, values: dict[tuple[str, ...], str]
) -> Path | None:
    if options.dry_run:
        return None
    assert deployment.file is not None
    rig_entry.write(deployment.file, rig.name, values)
    return deployment.file


def _text(rig: Rig, lines: dict[str, AxisLine], found: Readings, file: Path | None) -> str:
    rows = []
    for name, line in lines.items():
        axis = AXES[name]
        steps = f"{line.steps:.{_DIGITS[name]}f} ± {line.steps_error:.2g} {axis.density}"
        rows.append(f"{rig.name}: {name}: {steps}, offset {line.offset:.4f} ± {line.offset_error:.2g} steps")
        for reading, residual in zip(found[name], line.residuals, strict=True):
            read = f"{reading.steps:11.4f} steps, read {axis.shown(reading.place)}"
            rows.append(f"  {read}, residual {axis.shown(residual, '+')} of {axis.shown(axis.tolerance)}")
    then = f"; 'dodo rig calibrate {rig.name}' gives the rig its limits by these constants"
    rows.append(f"written into {file}{then}" if file else "nothing is written (--dry-run)")
    return "".join(f"{printable(row)}\n" for row in rows)


def _json(rig: Rig, lines: dict[str, AxisLine], found: Readings, file: Path | None) -> str:
    axes: dict[str, Any] = {}
    for name, line in lines.items():
        axes[name] = {
            "steps": line.steps,
            "offset": line.offset,
            "steps-error": line.steps_error,
            "offset-error": line.offset_error,
            "unit": AXES[name].density,
            "readings": [
                {"steps": reading.steps, "reads": reading.place, "residual": residual}
                for reading, residual in zip(found[name], line.residuals, strict=True)
            ],
        }
    return json_text({"rig": rig.name, "axes": axes, "written": str(file) if file else ""})
