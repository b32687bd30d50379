"""Images of services that are a user's own: each from the ``Dockerfile`` beside its manifest, on a shared stage."""

import re
from collections.abc import Collection, Iterable
from pathlib import Path

from dodo_dsl.images.names import SHARED, Image
from dodo_dsl.spec.manifest import Manifest

DOCKERFILE = "Dockerfile"
BASE_ARGUMENT = "DODO_BASE"
_DEFAULT = re.compile(rf"^\s*ARG\s+{BASE_ARGUMENT}=[\"']?(?:\S*/)?(?P<name>[\w-]+)(?::\S*)?\s*$", re.MULTILINE | re.I)


def dockerfiles(manifests: Iterable[Manifest], shipped: Collection[str]) -> dict[str, Path | None]:
    """The Dockerfile of each image that is none of DoDo's, by its bare name; None where a service has none."""
    found: dict[str, Path | None] = {}
    for manifest in sorted(manifests, key=lambda m: m.image):
        if manifest.has_own_image and manifest.image not in shipped:
            file = manifest.folder / DOCKERFILE
            found[manifest.image] = found.get(manifest.image) or (file if file.is_file() else None)
    return found


def build_words(image: Image, dockerfile: Path) -> list[str]:
    """The docker command that builds an image; the context is the folder above that of all services."""
    words = ["buildx", "build", "--file", str(dockerfile), "--tag", image.reference]
    words += ["--build-arg", f"{BASE_ARGUMENT}={base_of(image, dockerfile)}", "--output", "type=docker"]
    return [*words, *(["--platform", image.platform] if image.platform else []), str(dockerfile.resolve().parents[2])]


def base_of(image: Image, dockerfile: Path) -> str:
    """The shared image by the same prefix and tag that the default of the Dockerfile's argument names, or base."""
    match = _DEFAULT.search(dockerfile.read_text(encoding="utf-8", errors="replace"))
    name = match["name"] if match and match["name"] in SHARED else SHARED[0]
    return beside(image.reference, name)


def beside(reference: str, name: str) -> str:
    """Another image by the same prefix and tag."""
    prefix, _, last = reference.rpartition("/")
    return f"{prefix}/{name}:{last.rpartition(':')[2]}"
