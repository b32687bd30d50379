"""What a registry says of an image before it is pulled: its layers for one platform, and their sizes."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from dodo_dsl.images import docker_command
from dodo_dsl.images.docker_command import DockerError

UNPACKED = 3
"""Bytes on the disk for each byte in a registry, where layers are packed: what Debian and Python packages take."""
_DENIED = ("denied", "unauthorized", "no basic auth", "401", "403")


@dataclass(frozen=True)
class RemoteImage:
    """An image of a registry; ``layers`` has the bytes of each, as packed there, by the digest of its content."""

    reference: str
    layers: Mapping[str, int]


def remote_image(reference: str, platform: str) -> RemoteImage:
    """An image for a platform; raises DockerError if the registry has none."""
    manifest = _inspect(reference, "--raw")
    whole = reference
    if "manifests" in manifest:
        whole = f"{_repository(reference)}@{_digest(reference, manifest['manifests'], platform)}"
        manifest = _inspect(whole, "--raw")
    image = _inspect(whole, "--format", "{{json .Image}}")
    found = f"{image.get('os')}/{image.get('architecture')}"
    if found != platform:
        raise DockerError(f"{reference} is for {found}, not for {platform}")
    sizes, contents = [int(layer["size"]) for layer in manifest["layers"]], image["rootfs"]["diff_ids"]
    if len(sizes) != len(contents):
        raise DockerError(f"{reference} has {len(sizes)} layers, but says what is in {len(contents)}")
    return RemoteImage(reference, dict(zip(contents, sizes, strict=True)))


def bytes_of(images: Iterable[RemoteImage], present: Iterable[str] = ()) -> int:
    """Bytes in the registry of all layers that are not present, each once."""
    layers = {digest: size for image in images for digest, size in image.layers.items()}
    return sum(layers[digest] for digest in layers.keys() - set(present))


def local_layers() -> set[str]:
    """The digests of the layers of all images that the engine has."""
    names = docker_command.ask("image", "ls", "--quiet", "--no-trunc").split()
    if not names:
        return set()
    said = docker_command.ask("image", "inspect", "--format", "{{json .RootFS.Layers}}", *dict.fromkeys(names))
    return {digest for line in said.splitlines() for digest in json.loads(line) or ()}


def _digest(reference: str, manifests: Iterable[Mapping[str, Any]], platform: str) -> str:
    known: dict[str, str] = {}
    for one in manifests:
        about = one.get("platform", {})
        known.setdefault(f"{about.get('os')}/{about.get('architecture')}", str(one["digest"]))
    if platform not in known:
        there = ", ".join(name for name in known if not name.startswith("unknown"))
        raise DockerError(f"{reference} is for {there}, not for {platform}")
    return known[platform]


def _repository(reference: str) -> str:
    name = reference.partition("@")[0]
    head, sign, tag = name.rpartition(":")
    return head if sign and "/" not in tag else name


def _inspect(reference: str, *words: str) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(docker_command.ask("buildx", "imagetools", "inspect", reference, *words))
    except DockerError as error:
        login = f"; log in with: docker login {reference.partition('/')[0]}" if _is_denied(str(error)) else ""
        raise DockerError(f"{reference} is not to be had: {str(error).removeprefix('ERROR: ')}{login}") from None
    except ValueError:
        raise DockerError(f"{reference} is not to be had: its registry does not answer as registries do") from None
    return found


def _is_denied(text: str) -> bool:
    return any(word in text for word in _DENIED)
