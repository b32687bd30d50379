"""Draws what a camera of the vehicle sees of a map."""

LIBRARIES = ("trimesh",)
"""What it imports only where a map has meshes; the fork server does so beforehand."""
