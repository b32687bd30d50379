"""Which messages only a simulation has, and those who control it: no bus of a car carries them.

Imports the standard library alone.
"""

PACKAGES = ("opendlv.sim.", "dodo.", "cluon.data.")
"""The names of these messages begin so."""
POSE = ("opendlv.sim.Frame", "opendlv.sim.KinematicState")
"""Those that tell where the vehicle truly is, or how it moves."""


def is_of_the_world(name: str) -> bool:
    """Whether a message of this name is one of them; a sender stamp may follow."""
    return name.startswith(PACKAGES)
