"""dodo rig: operate a rig manually: status, motion, calibration, quarantine and camera."""

import argparse
import math
from collections.abc import Callable, Mapping
from typing import Any, TextIO

from dodo_dsl.cli import rig_measure, rig_truth, selection
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.cli.numbers import finite, patience
from dodo_dsl.run.rigs import access, leases
from dodo_dsl.run.rigs.access import MANUAL
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec.deployment import FILE_NAME, Deployment
from dodo_dsl.spec.rig import EMULATED, EMULATED_RIGS, LIMIT_UNITS, Rig
from dodo_dsl.terminal import json_text, printable

EXAMPLES = """examples:
  dodo rig status                       every rig of dodo.yml: quarantine and position
  dodo rig calibrate kiwi-dynamic       find its home; keep its path clear
  dodo rig goto kiwi-dynamic 0.2 -0.1 90
  dodo rig home kiwi-dynamic            move to its switches
  dodo rig clear kiwi-dynamic           end its quarantine after a repair
  dodo rig goto emulated 0 0 0          on any machine with the firmware emulator
  dodo rig measure kiwi-dynamic         the constants of its axes, by a ruler and a protractor
  dodo rig truth kiwi-static -o truths/desk.json
                                        a snapshot, and of the emulated rig the truth for object-detection

exit codes: 0 done, 1 a rig is in quarantine or readings do not fit, 2 wrong usage or a position outside the limits,
3 the rig failed
"""
ACTIONS = {
    "status": "show whether a rig is in quarantine, and its position",
    "home": "move to its switches",
    "goto": "move to a position within its limits",
    "calibrate": "find its home",
    "clear": "end its quarantine after a repair",
}


def add(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name, text in ACTIONS.items():
        action = actions.add_parser(name, help=text, description=text)
        count = "?" if name == "status" else None
        action.add_argument(
            "rig", nargs=count, metavar="RIG", help="name of a rig in dodo.yml, emulated or emulated-circle"
        )
        for axis, unit in {"x": "m", "y": "m", "yaw": "degrees"}.items() if name == "goto" else ():
            action.add_argument(axis, type=finite, metavar=axis.upper(), help=f"in {unit}, 0 is the middle")
        wait = "maximum wait for a busy rig, in s (default: 60)"
        action.add_argument("--wait", type=patience, default=60.0, metavar="S", help=wait)
        action.add_argument("--json", action="store_true", help="output as JSON")
    for name, module in {"measure": rig_measure, "truth": rig_truth}.items():
        formatter = argparse.RawDescriptionHelpFormatter
        module.add(
            actions.add_parser(
                name, help=module.SUMMARY, description=module.SUMMARY, epilog=module.EXAMPLES, formatter_class=formatter
            )
        )


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    def say(text: str) -> None:
        stderr.write(f"{printable(text)}\n")

    deployment = selection.checked_deployment()
    chosen = _chosen(options, deployment)
    if options.action == "truth":
        stdout.write(rig_truth.make(options, deployment, chosen[0], say) + "\n")
        return Exit.OK
    if options.action == "measure":
        return rig_measure.measure(options, chosen[0], stdout, stderr)
    results = [_one(options, rig, say) for rig in chosen]
    if options.json:
        stdout.write(json_text(results))
    else:
        stdout.writelines(f"{printable(_sentence(result))}\n" for result in results)
        if not results:
            stdout.write(f"{FILE_NAME} has no rigs; every machine has '{EMULATED}': dodo rig status {EMULATED}\n")
    if any(result.get("error") for result in results):
        return Exit.ERROR
    return Exit.PROBLEMS if any(result["quarantine"] for result in results) else Exit.OK


def _chosen(options: argparse.Namespace, deployment: Deployment) -> list[Rig]:
    if options.rig is None:
        return [rig for rig in deployment.rigs.values() if not rig.is_emulated]
    rig = deployment.rig(options.rig)
    if rig is None:
        raise UsageError(
            f"unknown rig '{options.rig}', expected one of {', '.join([*EMULATED_RIGS, *deployment.rigs])}"
        )
    return [rig]


def _one(options: argparse.Namespace, rig: Rig, say: Callable[[str], None]) -> dict[str, Any]:
    """The result of the action on one rig; a status includes its fault."""
    result: dict[str, Any] = {"rig": rig.name, "kind": rig.kind, "quarantine": ""}
    devices = [text for key in ("serial", "camera.source") if (text := rig.text(key))]
    if options.action == "clear":
        leases.clear_quarantine(rig.name, devices)
        return result
    if not rig.is_emulated:
        result["quarantine"] = leases.quarantined(rig.name, devices)
    if rig.entry("serial") is None:
        if options.action != "status":
            raise UsageError(f"rig '{rig.name}' has no serial port, so it cannot move")
        return result
    try:
        return {**result, **_moved(options, rig, say)}
    except RigProblem as problem:
        if options.action != "status":
            raise
        return {**result, "error": str(problem)}


def _moved(options: argparse.Namespace, rig: Rig, say: Callable[[str], None]) -> dict[str, Any]:
    place = (options.x, options.y, options.yaw) if options.action == "goto" else ()
    words = [*access.flags(rig), options.action, *(f"{number:g}" for number in place)]
    user = f"'dodo rig {options.action}'"
    with access.occupied(rig.cid, user, leases.devices_in(words), say, options.wait) as query:
        return query((MANUAL, words))


def _limits_sentence(limits: Mapping[str, Any]) -> list[str]:
    if limits.get("from", "built") == "built":
        return []
    what = "its memory is damaged, and these limits hold" if limits["from"] == "damaged" else "limits in its memory"
    shown = {name: f"{limits[name]:g} {unit}" for name, unit in LIMIT_UNITS.items()}
    shown["yaw"] = f"{math.degrees(limits['yaw']):.4g} deg"
    return [f"{what}: " + ", ".join(f"{name} {text}" for name, text in shown.items())]


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
        parts += _limits_sentence(result.get("limits") or {})
    if result["quarantine"]:
        parts.append(f"in quarantine: {result['quarantine']}; 'dodo rig clear {result['rig']}' ends it")
    return f"{name} {'; '.join(parts) or 'not in quarantine'}"
