"""Draws what a camera of the vehicle sees of a map."""

LIBRARIES = ("services.virtual_camera.map.mesh_library",)
"""What it imports only where a map has meshes; the fork server does so beforehand."""
