"""Units and titles of what is plotted: OpenDLV's messages name neither."""

from dodo_dsl.report.viewer.recorded import FRAME

UNITS = {
    "groundSteering": "rad", "groundSpeed": "m/s", "angle": "rad", "distance": "m", "voltage": "V", "temperature": "°C",
    "pressure": "Pa", "heading": "rad", "northHeading": "rad", "latitude": "deg", "longitude": "deg",
    "vx": "m/s", "vy": "m/s", "vz": "m/s", "rollRate": "rad/s", "pitchRate": "rad/s", "yawRate": "rad/s",
    "accelerationX": "m/s²", "accelerationY": "m/s²", "accelerationZ": "m/s²",
    "angularVelocityX": "rad/s", "angularVelocityY": "rad/s", "angularVelocityZ": "rad/s",
}  # fmt: skip
"""By the names of fields."""
_OF_FRAMES = {"x": "m", "y": "m", "z": "m"}
_TITLES = {
    "opendlv.proxy.GroundSteeringRequest": "Steering",
    "opendlv.proxy.PedalPositionRequest": "Pedal position",
    "opendlv.proxy.GroundSpeedRequest": "Speed request",
    "opendlv.proxy.GroundSteeringReading": "Measured steering",
    "opendlv.proxy.GroundSpeedReading": "Measured speed",
}
"""Of messages with one field."""


def unit(message: str, field: str) -> str:
    """Empty if it is not known."""
    return _OF_FRAMES.get(field, "") if message == FRAME else UNITS.get(field, "")


def title(message: str, field: str, sender: int) -> str:
    """``Steering``, ``vx of KinematicState``, ``distance of DistanceReading/2``"""
    name = message.rpartition(".")[2]
    stamp = f"/{sender}" if sender else ""
    return f"{_TITLES[message]}{stamp}" if message in _TITLES else f"{field} of {name}{stamp}"


def of_series(name: str) -> tuple[str, str]:
    """Title and unit of what an evaluator calls ``groundSteering of GroundSteeringRequest/0``; else its own name."""
    field, _, message = name.partition(" of ")
    short, _, sender = message.partition("/")
    known = next((full for full in _TITLES if full.endswith(f".{short}")), "")
    own = title(known, field, int(sender)) if known and sender.isascii() and sender.isdigit() else name
    return own, UNITS.get(field, "")
