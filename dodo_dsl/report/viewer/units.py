"""Units and titles of what is plotted: OpenDLV's messages name neither."""

UNITS = {
    "groundSteering": "rad", "groundSpeed": "m/s", "angle": "rad", "distance": "m", "voltage": "V", "temperature": "°C",
    "pressure": "Pa", "heading": "rad", "northHeading": "rad", "latitude": "deg", "longitude": "deg",
    "vx": "m/s", "vy": "m/s", "vz": "m/s", "rollRate": "rad/s", "pitchRate": "rad/s", "yawRate": "rad/s",
    "accelerationX": "m/s²", "accelerationY": "m/s²", "accelerationZ": "m/s²",
    "angularVelocityX": "rad/s", "angularVelocityY": "rad/s", "angularVelocityZ": "rad/s",
    "x of Frame": "m", "y of Frame": "m", "z of Frame": "m",
}  # fmt: skip
"""By a field's name, or that with its message's."""
_TITLES = {
    "groundSteering of GroundSteeringRequest": "Steering",
    "position of PedalPositionRequest": "Pedal position",
    "groundSpeed of GroundSpeedRequest": "Speed request",
    "groundSteering of GroundSteeringReading": "Measured steering",
    "groundSpeed of GroundSpeedReading": "Measured speed",
}
"""Of messages with one field."""


def unit_of(signal: str) -> str:
    """Of ``groundSteering of GroundSteeringRequest/2``; empty if it is not known."""
    return UNITS.get(signal.partition("/")[0]) or UNITS.get(signal.partition(" of ")[0], "")


def title_of(signal: str) -> str:
    """``Steering/2`` of ``groundSteering of GroundSteeringRequest/2``; others keep their names."""
    name, _, sender = signal.partition("/")
    return f"{_TITLES[name]}/{sender}".removesuffix("/0").removesuffix("/") if name in _TITLES else signal
