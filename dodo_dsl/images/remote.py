"""What a registry says of an image before it is pulled: its layers for one platform, and their sizes."""

import json
from typing import Any

from dodo_dsl.images import docker_command
from dodo_dsl.images.docker_command import DockerError

UNPACKED = 3
"""Bytes on the disk for each byte in a registry, where layers are packed: what Debian and Python packages take."""
_DENIED = ("denied", "unauthorized", "no basic auth", "401", "403")


def layers(reference: str, platform: str) -> dict[str, int]:
    """Bytes of each layer, as packed in the registry, by its digest there; raises DockerError if there is no image."""
    manifest = _manifest(reference)
    if "manifests" not in manifest:
        return {layer["digest"]: int(layer["size"]) for layer in manifest["layers"]}
    known: dict[str, str] = {}
    for one in manifest["manifests"]:
        about = one.get("platform", {})
        known.setdefault(f"{about.get('os')}/{about.get('architecture')}", str(one["digest"]))
    if platform not in known:
        there = ", ".join(name for name in known if not name.startswith("unknown"))
        raise DockerError(f"{reference} is for {there}, not for {platform}")
    return layers(f"{reference.partition('@')[0]}@{known[platform]}", platform)


def _manifest(reference: str) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(docker_command.ask("buildx", "imagetools", "inspect", "--raw", reference))
    except DockerError as error:
        is_denied = any(word in str(error) for word in _DENIED)
        login = f"; log in with: docker login {reference.partition('/')[0]}" if is_denied else ""
        raise DockerError(f"{reference} is not to be had: {str(error).removeprefix('ERROR: ')}{login}") from None
    except ValueError:
        raise DockerError(f"{reference} is not to be had: its registry does not answer as registries do") from None
    return found
