"""Draws what a camera of the vehicle sees of a map."""
