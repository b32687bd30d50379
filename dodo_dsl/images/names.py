"""The images by name: DoDo's, and those of a user's own services.

The latter are built each from the ``Dockerfile`` beside its manifest, on a shared image.
"""

import re
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from platform import machine

from dodo_dsl.spec.manifest import Manifest

SANDBOX = "sandbox"
_FOR_X86 = ("ros-bridge",)
"""Those without what they need for other machines: there are no wheels of cyclonedds."""
SHARED = ("base", "geometry", "vision")
"""What applications and services may use as base images."""
DODO = "dodo"
"""DoDo itself, for a pipeline's jobs: no test needs it, so it is built and pushed only where it is named."""

PLATFORM = re.compile(r"linux/[a-z0-9]+(/v[0-9]+)?")
"""Such as linux/arm64, as Docker writes it."""
DOCKERFILE = "Dockerfile"
BASE_ARGUMENT = "DODO_BASE"
_DEFAULT = re.compile(rf"^\s*ARG\s+{BASE_ARGUMENT}=[\"']?(?:\S*/)?(?P<name>[\w-]+)(?::\S*)?\s*$", re.MULTILINE | re.I)


def known(manifests: Iterable[Manifest]) -> tuple[str, ...]:
    """The images of DoDo's: the sandbox, those of services and of the ROS bridge, and those for applications.

    A manifest with a complete reference (``registry.example.org/team/radar:1``) uses an image from elsewhere.
    """
    return (*SHARED, *sorted({SANDBOX, *_FOR_X86, *(m.image for m in manifests if m.has_own_image)}))


def platforms_of(name: str, wanted: Sequence[str], *, is_named: bool) -> Sequence[str] | None:
    """For which of the wanted platforms an image of DoDo's is built; None for none, unless it is asked for by name."""
    if name not in _FOR_X86 or is_named:
        return wanted
    if not wanted:
        return wanted if machine() in ("x86_64", "AMD64") else None
    return [platform for platform in wanted if platform == "linux/amd64"] or None


def dockerfiles(manifests: Iterable[Manifest], shipped: Collection[str]) -> dict[str, Path | None]:
    """The Dockerfile of each image that is none of DoDo's, by its bare name; None if a service has none."""
    found: dict[str, Path | None] = {}
    for manifest in sorted(manifests, key=lambda m: m.image):
        if manifest.has_own_image and manifest.image not in shipped:
            file = manifest.folder / DOCKERFILE
            found[manifest.image] = found.get(manifest.image) or (file if file.is_file() else None)
    return found


def base_of(dockerfile: Path) -> str:
    """The shared image that the default of the Dockerfile's argument names, or base."""
    match = _DEFAULT.search(dockerfile.read_text(encoding="utf-8", errors="replace"))
    return match["name"] if match and match["name"] in SHARED else SHARED[0]
