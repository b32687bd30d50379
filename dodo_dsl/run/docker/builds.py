"""Names for the images that a run builds, so that an application's file replaces no image on the engine."""

import hashlib
import json
from collections.abc import Collection, Mapping
from typing import Any

from dodo_dsl.application.service_environment import image_variable

REPOSITORY = "dodo-build"


def is_built(service: Mapping[str, Any]) -> bool:
    """Whether a run builds the image; one that a pipeline names by its digest is pulled."""
    return "build" in service and "@" not in str(service.get("image") or "")


def private_images(services: Mapping[str, Any], application: Collection[str]) -> dict[str, str]:
    """The names of built images by the variables that set them, for all services of the application that use them.

    A name follows from the build and the image's name in the file: the next run of the same application finds its
    layers and replaces the image, another application has other names.
    """
    named = {
        str(service["image"]): f"{REPOSITORY}:{_digest(service)}"
        for name, service in services.items()
        if name in application and is_built(service) and service.get("image")
    }
    return {
        image_variable(name): named[image]
        for name, service in services.items()
        if name in application and (image := str(service.get("image"))) in named
    }


def _digest(service: Mapping[str, Any]) -> str:
    text = json.dumps([service["image"], service["build"]], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:32]
