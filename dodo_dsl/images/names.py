"""The images by name: DoDo's, and those of a user's own services.

The latter are built each from the ``Dockerfile`` beside its manifest, on a shared stage.
"""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dodo_dsl.diagnostics import did_you_mean
from dodo_dsl.spec.manifest import Manifest

SANDBOX = "sandbox"
SHARED = ("base", "geometry", "vision")
"""Stages that applications and services may use as base images."""
DODO = "dodo"
"""DoDo itself, for a pipeline's jobs: no test needs it, so it is built and pushed only where it is named."""

PLATFORM = re.compile(r"linux/[a-z0-9]+(/v[0-9]+)?")
"""Such as linux/arm64, as Docker writes it."""


class NoSuchImage(Exception):
    """A name without an image of DoDo's; one sentence."""


@dataclass(frozen=True)
class Image:
    """An image; ``name`` is also its stage in ``services/Dockerfile``, unless it is that of a user's own service."""

    name: str
    reference: str
    platform: str = ""
    """That of the engine if it is empty."""


def of_platforms(images: Sequence[Image], platforms: Sequence[str]) -> list[Image]:
    """The images for each platform; if there are several, the tag names it: ``collision:1-arm64``."""
    if len(platforms) < 2:
        return [replace(image, platform=platform) for platform in platforms for image in images] or list(images)
    return [replace(image, reference=tagged(image, one), platform=one) for one in platforms for image in images]


def tagged(image: Image, platform: str) -> str:
    """The reference of an image that is one of a manifest list."""
    return f"{image.reference}-{platform.partition('/')[2].replace('/', '-')}"


def known(manifests: Iterable[Manifest]) -> tuple[str, ...]:
    """The stages that are images: the sandbox, those of services, and those for applications.

    A manifest with a complete reference (``registry.example.org/team/radar:1``) uses an image from elsewhere.
    """
    bare = {m.image for m in manifests if m.has_own_image}
    return (*SHARED, *sorted({SANDBOX, *bare}))


def choose(words: Sequence[str], names: Sequence[str], prefix: str, tag: str) -> list[Image]:
    """The images with these names, those of tests without any; raises NoSuchImage."""
    all_names = (*names, DODO)
    for word in words:
        if word not in all_names:
            hint = did_you_mean(word, all_names) or f"known: {', '.join(sorted(all_names))}"
            raise NoSuchImage(f"there is no image '{word}'; {hint}")
    return [Image(name, f"{prefix}/{name}:{tag}") for name in all_names if name in (words or names)]


DOCKERFILE = "Dockerfile"
BASE_ARGUMENT = "DODO_BASE"
_DEFAULT = re.compile(rf"^\s*ARG\s+{BASE_ARGUMENT}=[\"']?(?:\S*/)?(?P<name>[\w-]+)(?::\S*)?\s*$", re.MULTILINE | re.I)


def dockerfiles(manifests: Iterable[Manifest], shipped: Collection[str]) -> dict[str, Path | None]:
    """The Dockerfile of each image that is none of DoDo's, by its bare name; None if a service has none."""
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
