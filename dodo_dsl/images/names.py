"""The images and their names in a deployment."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

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
    """That of the engine where it is empty."""


def of_platforms(images: Sequence[Image], platforms: Sequence[str]) -> list[Image]:
    """The images for each platform; where there are several, the tag names it: ``collision:1-arm64``."""
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
