"""dodo rig measure: the constants of a rig's axes, or of its camera, measured and written into dodo.yml.

Axes: the rig moves to positions, and the person at the rig reads where it truly is. Camera: it takes frames of a board.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.cli.numbers import patience, positive
from dodo_dsl.run.rigs import access, calibration, rig_entry
from dodo_dsl.run.rigs.access import MANUAL, Command, occupied
from dodo_dsl.run.rigs.calibration import FEWEST, Axis, AxisLine, CalibrationProblem, Reading, ReadingOff
from dodo_dsl.run.rigs.leases import devices_in
from dodo_dsl.spec import quantity
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import load_manifests
from dodo_dsl.spec.rig import CIRCLE, Rig
from dodo_dsl.terminal import printable

SHARE = 0.8
"""Of each range that is measured: the constants may be wrong by up to 10 % and 10 cm before."""
RETAKES = 2
ANY_HEADING = (-150.0, 150.0)
"""degrees, of a yaw without bounds."""
FRAMES = 12
DECIMALS = {"px": 3, "deg": 4, "": 6}
"""Of the intrinsics by their units."""
SUMMARY = "measure the constants of its axes, or its camera, and write them into dodo.yml"
EXAMPLES = """examples:
  dodo rig measure kiwi-dynamic         it moves to 5 positions of each axis, and asks for the true ones
  dodo rig measure kiwi-dynamic --axes yaw --places 9
  dodo rig measure kiwi-dynamic --camera
                                        its camera's optics, with the printed board of docs/rigs/board.svg

A residual may be 1 mm, or 0.5 degrees of the yaw; otherwise nothing is written, and the exit code is 1.
"""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="name of a rig in dodo.yml")
    parser.add_argument("--axes", metavar="A,B", default="x,y,yaw", help="axes to measure (default: x,y,yaw)")
    parser.add_argument("--places", type=positive, default=5, metavar="N", help="positions of each axis (default: 5)")
    parser.add_argument("--camera", action="store_true", help="measure its camera instead, with frames of the board")
    parser.add_argument("--dry-run", action="store_true", help="write nothing")
    wait = "maximum wait for a busy rig, in s (default: 60)"
    parser.add_argument("--wait", type=patience, default=60.0, metavar="S", help=wait)


@dataclass(frozen=True)
class Dialogue:
    """With the person at a rig that nobody else uses meanwhile."""

    query: Callable[[Command], dict[str, Any]]
    stderr: TextIO

    def say(self, text: str) -> None:
        self.stderr.write(f"{printable(text)}\n")

    def ask(self, prompt: str) -> str:
        """The answer to a prompt; raises UsageError at the end of standard input."""
        self.stderr.write(printable(prompt))
        self.stderr.flush()
        line = sys.stdin.readline()
        if not line:
            self.stderr.write("\n")
            raise UsageError("standard input ended, and nothing is written")
        return line.strip()


def measure(options: argparse.Namespace, deployment: Deployment, rig: Rig, stdout: TextIO, stderr: TextIO) -> int:
    """Measures and writes; the exit code. Raises UsageError, RigProblem and LeaseTimeout."""
    if rig.is_emulated or deployment.file is None:
        raise UsageError("the emulated rig is as its firmware has it, and has no entry in dodo.yml to write")
    if options.camera:
        snapshot = access.snapshot(rig, load_manifests(deployment.services)[0], None)
        devices = devices_in(snapshot.words)
    else:
        axes = _axes(options, rig)
        flags = access.flags(rig)
        devices = devices_in(flags)

    def say(text: str) -> None:
        stderr.write(f"{printable(text)}\n")

    try:
        with occupied(rig.cid, "'dodo rig measure'", devices, say, options.wait) as query:
            dialogue = Dialogue(query, stderr)
            if options.camera:
                keys, value, rows = _camera(dialogue, (snapshot.program, snapshot.words))
            else:
                keys, value, rows = _constants(dialogue, (MANUAL, flags), rig, axes, options.places)
        if not options.dry_run:
            rig_entry.write(deployment.file, rig.name, keys, value)
    except CalibrationProblem as problem:
        say(f"dodo rig measure: {problem}; nothing is written")
        return Exit.PROBLEMS
    then = "" if options.camera else f"; 'dodo rig calibrate {rig.name}' gives the rig its limits by these constants"
    rows.append("nothing is written (--dry-run)" if options.dry_run else f"written into {deployment.file}{then}")
    stdout.writelines(f"{printable(row)}\n" for row in rows)
    return Exit.OK


Measured = tuple[tuple[str, ...], dict[str, Any], list[str]]
"""Keys within the rig and the mapping for them, and lines about it."""


def _axes(options: argparse.Namespace, rig: Rig) -> list[Axis]:
    known = calibration.axes(rig.kind == CIRCLE)
    names = [name for name in options.axes.split(",") if name]
    for name in names:
        if name not in known:
            raise UsageError(f"--axes: there is no axis '{name}', expected some of {', '.join(known)}")
    if options.places < FEWEST:
        raise UsageError(f"--places is {options.places}, expected at least {FEWEST}")
    if rig.entry("serial") is None:
        raise UsageError(f"rig '{rig.name}' has no serial port, so it cannot move")
    return [axis for axis in known.values() if axis.name in names]


def _constants(dialogue: Dialogue, program: Command, rig: Rig, axes: Sequence[Axis], count: int) -> Measured:
    def move(*words: str) -> dict[str, Any]:
        return dialogue.query((program[0], [*program[1], *words]))

    dialogue.ask(f"rig '{rig.name}' finds its home first: clear its workspace, and press Enter ")
    reach = move("calibrate")["reach"]
    value: dict[str, Any] = {}
    rows = []
    for axis in axes:
        readings, line = _readings(dialogue, move, axis, _goals(axis, reach[axis.name] or ANY_HEADING, count))
        numbers = {"offset": line.offset} if axis.circle else {"steps": line.steps, "offset": line.offset}
        _refuse_implausible(axis.name, numbers)
        steps, offset = f"{line.steps:.{axis.digits}f}", f"{line.offset:.4f}"
        value[axis.name] = {} if axis.circle else {"steps": f"{steps} {axis.density}"}
        value[axis.name]["offset"] = f"{offset} steps"
        errors = f"{steps} ± {line.steps_error:.2g} {axis.density}, offset {offset} ± {line.offset_error:.2g} steps"
        rows.append(f"{rig.name}: {axis.name}: {errors}")
        for reading, residual in zip(readings, line.residuals, strict=True):
            read = f"{reading.steps:11.4f} steps, read {axis.shown(reading.position)}"
            rows.append(f"  {read}, residual {axis.shown(residual, '+')} of {axis.shown(axis.tolerance)}")
    return ("axes",), value, rows


def _goals(axis: Axis, limits: Sequence[float], count: int) -> list[float]:
    low, high = limits
    middle, half = (low + high) / 2, SHARE * (high - low) / 2
    decimals = 2 if axis.unit == "m" else 0
    return [round(middle - half + 2 * half * index / (count - 1), decimals) for index in range(count)]


def _readings(
    dialogue: Dialogue, move: Callable[..., dict[str, Any]], axis: Axis, goals: Sequence[float]
) -> tuple[list[Reading], AxisLine]:
    """Readings at the goals and the line through them; one that the others contradict is read again."""

    def read(goal: float, which: str) -> Reading:
        position = {"x": 0.0, "y": 0.0, "yaw": 0.0, axis.name: goal}
        answer = move("goto", *(f"{value:g}" for value in position.values()))
        counted = f"the rig stands at {axis.shown(answer[axis.name])} by its counters"
        prompt = f"{axis.name}, {which}: {counted}. Its true position, such as {axis.shown(goal)}: "
        while True:
            try:
                return Reading(answer["steps"][axis.name], float(quantity.convert(dialogue.ask(prompt), axis.unit)))
            except quantity.QuantityError as error:
                dialogue.say(f"{error}; {error.hint}" if error.hint else str(error))

    readings = [read(goal, f"{number} of {len(goals)}") for number, goal in enumerate(goals, 1)]
    for _ in range(RETAKES):
        try:
            return readings, calibration.fit(axis, readings)
        except ReadingOff as off:
            dialogue.say(f"{off}; it is read again")
            readings[off.index] = read(goals[off.index], "again")
    return readings, calibration.fit(axis, readings)


def _refuse_implausible(axis: str, numbers: dict[str, float]) -> None:
    """The gantry takes no constants that are far from the firmware's."""
    known = load_manifests()[0]["gantry"].parameters
    for what, number in numbers.items():
        about = known[f"{what}-{axis}"]
        assert about.minimum is not None and about.maximum is not None
        if not about.minimum <= number <= about.maximum:
            text = f"{axis}: {what} is {number:.6g} {about.unit}, expected {about.minimum:g} to {about.maximum:g}"
            raise CalibrationProblem(f"{text}: are units, signs and the middle of the readings right?")


def _camera(dialogue: Dialogue, snapshot: Command) -> Measured:
    import cv2  # it takes a second to import

    dialogue.say("hold the board close to all edges and corners of the frame, tilted by 20 to 45 degrees to all sides")
    views: list[calibration.BoardView] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "snapshot.png"
        while len(views) < FRAMES:
            dialogue.ask(f"frame {len(views) + 1} of {FRAMES}: hold the board still, and press Enter ")
            dialogue.query((snapshot[0], [*snapshot[1], f"--output={path}"]))
            frame = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
            seen = None if frame is None else calibration.view(frame)
            if seen is None:
                dialogue.say(f"it shows fewer than {calibration.FEWEST_CORNERS} corners of the board: once more")
            else:
                views.append(seen)
    found = calibration.intrinsics(views)
    entry: dict[str, Any] = {}
    for name, number in found.items():
        unit = "deg" if name == "fovy" else "" if name[0] in "kp" else "px"
        whole = name in ("width", "height")
        entry[name] = (
            number if whole else f"{number:.{DECIMALS[unit]}f} {unit}" if unit else round(number, DECIMALS[unit])
        )
    return ("camera", "intrinsics"), entry, [f"{name}: {text}" for name, text in entry.items()]
