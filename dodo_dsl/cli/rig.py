"""dodo rig: a rig by hand: where it is, home, to a place, calibrated, out of quarantine."""

import argparse
import asyncio
import json
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl.cli.exits import Exit
from dodo_dsl.diagnostics import format_text, has_errors
from dodo_dsl.run import leases, rigs
from dodo_dsl.source import Scalar
from dodo_dsl.spec.deployment import find_deployment, load_deployment
from dodo_dsl.spec.manifest import Parameter
from dodo_dsl.spec.rig import EMULATED, Rig
from dodo_dsl.spec.values import ValueProblem, convert

EXAMPLES = """examples:
  dodo rig status                       every rig of dodo.yml: whether it is fit, and where it is
  dodo rig calibrate kiwi-dynamic       it finds its home; nothing may stand in its way
  dodo rig goto kiwi-dynamic 0.2 -0.1 90
  dodo rig home kiwi-dynamic            to the place at its switches
  dodo rig clear kiwi-dynamic           its fault is mended: tests may run on it again
  dodo rig goto emulated 0 0 0          on any machine with the firmware's emulator

exit codes: 0 done, 1 a rig is in quarantine, 2 usage or a place out of the limits, 3 the rig cannot
"""
ACTIONS = ("status", "home", "goto", "calibrate", "clear")


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("action", choices=ACTIONS)
    parser.add_argument("rig", nargs="?", metavar="RIG", help="a name of dodo.yml, or emulated; status: default all")
    parser.add_argument("place", nargs="*", type=float, metavar="X Y YAW", help="goto: m, m and degrees, 0 the middle")
    parser.add_argument("--wait", type=float, default=60.0, metavar="S", help="most time that a busy rig is waited for")
    parser.add_argument("--json", action="store_true", help="as JSON")


class _Usage(Exception):
    """A sentence for the user; the exit code is 2."""


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    try:
        chosen = _chosen(options)
        results = [_one(options, rig, lambda text: print(text, file=stderr)) for rig in chosen]
    except _Usage as error:
        stderr.write(f"dodo rig: {error}\n")
        return Exit.USAGE
    except (rigs.RigProblem, leases.LeaseTimeout) as problem:
        stderr.write(f"dodo rig: {problem}\n")
        return Exit.USAGE if isinstance(problem, rigs.RigProblem) and problem.usage else Exit.ERROR
    if options.json:
        stdout.write(json.dumps(results, indent=2) + "\n")
    else:
        stdout.writelines(f"{_sentence(result)}\n" for result in results)
    if any(result.get("error") for result in results):
        return Exit.ERROR
    return Exit.PROBLEMS if any(result["quarantine"] for result in results) else Exit.OK


def _chosen(options: argparse.Namespace) -> list[Rig]:
    deployment, problems = load_deployment(find_deployment(Path.cwd()))
    if has_errors(problems):
        raise _Usage(f"dodo.yml has problems:\n{format_text(problems)}")
    if options.rig is None and options.action == "status":
        return list(deployment.rigs.values())
    if options.rig is None:
        raise _Usage(f"{options.action} needs the name of a rig")
    if len(options.place) != 3 * (options.action == "goto"):
        raise _Usage("goto takes a rig, X and Y in m and YAW in degrees; other actions take a rig only")
    rig = deployment.rig(options.rig)
    if rig is None:
        raise _Usage(f"there is no rig '{options.rig}', expected one of {', '.join([EMULATED, *deployment.rigs])}")
    return [rig]


def _one(options: argparse.Namespace, rig: Rig, say: Callable[[str], None]) -> dict[str, Any]:
    """Does the action on one rig; a fault of it is part of a status."""
    result: dict[str, Any] = {"rig": rig.name, "kind": rig.kind, "quarantine": ""}
    if options.action == "clear":
        rigs.clear(rig.name)
        return result
    if not rig.is_emulated:
        result["quarantine"] = rigs.quarantined(rig.name)
    if rig.entry("serial") is None:
        if options.action != "status":
            raise _Usage(f"rig '{rig.name}' has no serial port: nothing of it moves")
        return result
    try:
        return {**result, **asyncio.run(_moved(options, rig, say))}
    except asyncio.CancelledError:
        raise KeyboardInterrupt from None
    except rigs.RigProblem as problem:
        if options.action != "status":
            raise
        return {**result, "error": str(problem)}


async def _moved(options: argparse.Namespace, rig: Rig, say: Callable[[str], None]) -> dict[str, Any]:
    task = asyncio.current_task()
    assert task is not None
    for number in (signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, task.cancel)
    words = [*_flags(rig), options.action, *(f"{number:g}" for number in options.place)]
    what = f"'dodo rig {options.action}'"
    async with rigs.leased(rig.cid, what, say, options.wait) as descriptors:
        return await rigs.ask(rigs.HAND, words, descriptors=descriptors)


def _flags(rig: Rig) -> list[str]:
    """The rig's port and ranges as the gantry's flags; raises _Usage for a range that is none."""
    flags = []
    for key, flag, unit in (("serial", "serial", ""), *((f"limits.{a}", f"range-{a}", "m") for a in "xy"), YAW):
        entry = rig.entry(key)
        if entry is None or not isinstance(entry.value, Scalar):
            continue
        text = entry.value.text if flag == "serial" else _number(entry.value, flag, unit)
        flags.append(f"--{flag}={text}")
    return flags


YAW = ("limits.yaw", "range-yaw", "deg")


def _number(value: Scalar, flag: str, unit: str) -> str:
    try:
        return convert(Parameter(name=flag, type="number", unit=unit, help=""), value, Path.cwd()).text
    except ValueProblem as problem:
        raise _Usage(f"{flag}: {problem}") from None


def _sentence(result: dict[str, Any]) -> str:
    name = f"{result['rig']}:"
    parts = []
    if result.get("error"):
        parts.append(str(result["error"]))
    elif "says" in result:
        at = ""
        if result["x"] is not None:
            at = f", x = {result['x']:.3f} m, y = {result['y']:.3f} m, " + (f"yaw = {result['yaw']:.1f} degrees")
        parts.append(f"{result['says']}{at}")
    if result["quarantine"]:
        parts.append(f"in quarantine: {result['quarantine']}; `dodo rig clear {result['rig']}` ends that")
    return f"{name} {'; '.join(parts) or 'not in quarantine'}"
