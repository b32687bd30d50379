"""What a camera on a vehicle sees of a map: shared by the services that draw it or know where its models are."""

LIBRARIES = ("services.scene.mesh_library",)
"""What is imported only where a map has meshes; the fork server does so beforehand."""
