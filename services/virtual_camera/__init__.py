"""Draws what a camera of the vehicle sees of a map."""

from services.scene import LIBRARIES

__all__ = ["LIBRARIES"]
