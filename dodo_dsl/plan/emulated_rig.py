"""What replaces a rig's hardware where the rig is emulated."""

from collections.abc import Mapping
from dataclasses import replace

from dodo_dsl.plan.model import Flag, PlannedService
from dodo_dsl.spec.manifest import Manifest

CAMERA, DRAWN = "camera", "virtual-camera"
SOURCE = "emulated"

_SAME = (
    "map-path", "width", "height", "freq", "fovy", "x", "y", "z", "yaw", "pitch", "frame-id", "name.argb", "name.i420",
    "cid",
)  # fmt: skip
_TRUTH = ("truth-sender", "truth-classes", "truth-min-visible", "truth-min-height")
_OTHER = {
    "exposure": "shutter",
    "scene.light": "exposure",
    "scene.clutter": "clutter",
    "scene.noise": "noise",
    **{f"scene.{name}": name for name in _TRUTH},
}
"""Parameters that have another name in the virtual camera."""
_STILL = (Flag("start-x", "0"), Flag("start-y", "0"), Flag("start-yaw", "0"))


def hardware(service: PlannedService, manifests: Mapping[str, Manifest], image: str) -> PlannedService:
    """The virtual camera for an emulated rig's camera; any other service unchanged.

    For the application it is the same camera, with the same memories, size, rate and pose. The exposure time becomes
    the shutter's, and the camera is at the map's origin until something moves it.
    """
    given = {flag.name: flag for flag in service.flags}
    if service.uses != CAMERA or given.get("source") != Flag("source", SOURCE):
        return service
    flags = [given[name] for name in _SAME if name in given]
    renamed = [Flag(new, given[old].value) for old, new in _OTHER.items() if old in given]
    drawn = manifests[DRAWN]
    return replace(service, uses=DRAWN, image=image, process=drawn.process, flags=(*flags, *renamed, *_STILL))
