"""What an application tries over the bus to decide its own test, and why the test fails."""

from typing import NamedTuple

STRAIGHT, SIGNAL, PERCEPTION = "sil-closed-straight", "sil-open-straight", "sil-perception--light-1--clutter-0"
REPLAY = "dil-kiwi-track"


class BusAttack(NamedTuple):
    """An attack of ``stranger.py`` in a test that fails by it; ``reason`` is a pattern of the test's."""

    name: str
    test: str
    clock: str
    reason: str
    isolation: str = "network"


def only(message: str, *services: str) -> str:
    """The reason of a test in which the application sent what only services may send."""
    *others, last = [f"'{name}'" for name in services] or ["services of the test"]
    who = f"{', '.join(others)} and {last}" if others else last
    return f"^the application sent {message}, which only {who} may send$"


NAN = "^the application sent opendlv.proxy.GroundSteeringRequest/0 to '.*' after .* s: groundSteering is nan, not a "


def nobody(message: str) -> str:
    return f"^the application sent {message}, which no service of this test sends$"


WALL = "^hit wall "
BOX = "opendlv.logic.perception.DetectionBoundingBox/9"
FRAME, STATE = "opendlv.sim.Frame/0", "opendlv.sim.KinematicState/0"
RUNNER = "^the application sent dodo.TestBegin, which only the runner may send$"

ATTACKS = (
    BusAttack("honest", STRAIGHT, "lockstep", WALL),
    BusAttack("finish", STRAIGHT, "lockstep", only(FRAME, "pose")),
    BusAttack("finish", STRAIGHT, "realtime", only(FRAME, "pose")),
    BusAttack("finish-at-once", STRAIGHT, "lockstep", only(FRAME, "pose")),
    BusAttack("motion", STRAIGHT, "lockstep", only(STATE, "vehicle")),
    BusAttack("reset", STRAIGHT, "lockstep", nobody("opendlv.sim.Command")),
    BusAttack("end", SIGNAL, "lockstep", only("dodo.EndOfInput", "camera", "pose")),
    BusAttack("end", STRAIGHT, "realtime", only("dodo.EndOfInput", "camera", "pose", "vehicle")),
    BusAttack("begin", STRAIGHT, "lockstep", RUNNER),
    BusAttack("begin", STRAIGHT, "realtime", RUNNER),
    BusAttack("seek", REPLAY, "lockstep", nobody("cluon.data.PlayerCommand")),
    BusAttack("nan-once", STRAIGHT, "lockstep", NAN),
    BusAttack("nan-once", STRAIGHT, "realtime", NAN),
    BusAttack("unrecorded", STRAIGHT, "lockstep", WALL),
    BusAttack("join", STRAIGHT, "realtime", only(FRAME, "pose")),
    BusAttack("disguise", STRAIGHT, "realtime", WALL),
    BusAttack("channel", STRAIGHT, "lockstep", WALL),
    BusAttack("echo", PERCEPTION, "lockstep", "nothing was detected|no detection|left|recall"),
    BusAttack("boxes", PERCEPTION, "lockstep", only(BOX, "camera")),
    BusAttack("directly", STRAIGHT, "realtime", only(FRAME, "pose")),
    BusAttack("true-pose", STRAIGHT, "lockstep", WALL),
    BusAttack("true-pose", STRAIGHT, "realtime", WALL),
    BusAttack("true-pose", STRAIGHT, "realtime", WALL, "host"),
    BusAttack("easy", SIGNAL, "lockstep", ""),
    BusAttack("channel", STRAIGHT, "lockstep", WALL, "host"),
    BusAttack("join", STRAIGHT, "realtime", only(FRAME, "pose"), "host"),
)
