"""Runs a test on the host whose services and application try to open the port of a rig, as the user who calls it.

    python -m tests.hostile.reach_port FOLDER PORT

Prints the outcome, and for each program the ways in which it reached the port, as JSON.
"""

import json
import os
import sys
from dataclasses import replace
from pathlib import Path

from dodo_dsl.plan.model import PlannedService
from tests.run.helpers import PASS, READY, STARTED, WAIT, Bench

REACH = """
import ctypes, json, stat
port, number = {port!r}, {number}
libc = ctypes.CDLL(None, use_errno=True)
real = os.path.realpath(port)

def is_reached(path):
    try:
        opened = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return False
    return os.fstat(opened).st_rdev == number

def in_child(prepare):
    child = os.fork()
    if child == 0:
        try:
            prepare()
            os._exit(is_reached(real))
        except BaseException:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 1

def others(what):
    return any(is_reached(f"/proc/{{pid}}/{{what}}") for pid in os.listdir("/proc") if pid.isdigit())

def descriptors():
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            if any(is_reached(f"/proc/{{pid}}/fd/{{name}}") for name in os.listdir(f"/proc/{{pid}}/fd")):
                return True
        except OSError:
            pass
    return False

def bare():
    if libc.umount2(real.encode(), 2):
        raise OSError

def own_namespace():
    flags = 0x10020000 if os.getuid() else 0x20000
    if libc.unshare(flags):
        raise OSError
    bare()

def made():
    os.mknod("/tmp/made-{name}", stat.S_IFCHR | 0o666, number)
    try:
        if is_reached("/tmp/made-{name}"):
            os._exit(1)
    finally:
        os.unlink("/tmp/made-{name}")

ways = {{
    "its link": lambda: is_reached(port),
    "its file": lambda: is_reached(real),
    "a mount taken away": lambda: in_child(bare),
    "a namespace of its own": lambda: in_child(own_namespace),
    "a device made anew": lambda: in_child(made),
    "other programs' root": lambda: others("root" + real),
    "other programs' descriptors": descriptors,
}}
reached = [way for way, tried in ways.items() if tried()]
with open("{folder}/{name}.part", "w") as file:
    file.write(json.dumps(reached))
os.replace("{folder}/{name}.part", "{folder}/{name}.json")  # the judge passes when it sees the application's
"""


def main(argv: list[str]) -> int:
    folder, port = Path(argv[0]), argv[1]
    number = Path(port).stat().st_rdev
    bench = Bench(folder, "host")

    def reach(name: str) -> str:
        return REACH.format(port=port, number=number, name=name, folder=folder)

    judge = READY + f"while not os.path.exists('{folder}/app.json'): time.sleep(0.05)\n" + reach("judge") + PASS
    plan = bench.plan(
        judge=judge, environment=reach("camera") + READY + WAIT, application=reach("app") + STARTED + WAIT
    )
    mover = bench.script("mover", "import os, sys, time\n" + reach("mover") + READY + WAIT)
    moves = PlannedService("action", "mover", "gantry", "x", mover, port=port)
    (outcome,) = bench.run(replace(plan, services=(*plan.services, moves)))
    reached = {name: json.loads((folder / f"{name}.json").read_text()) for name in ("mover", "camera", "judge", "app")}
    print(json.dumps({"outcome": outcome.outcome, "reason": outcome.reason, "reached": reached}))
    return 0


if __name__ == "__main__":
    os.environ["DODO_LEASES"] = str(Path(sys.argv[1]) / "leases")
    sys.exit(main(sys.argv[1:]))
