"""The build context: what ``services/Dockerfile`` copies, from a checkout or from an installed wheel."""

import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from dodo_dsl import __version__, package_data
from dodo_dsl.images.names import Image

DEFINITION = "docker-bake.json"
LOCK = "locks/base.txt"
"""Versions of all packages, with the hashes of their wheels."""
REQUIREMENTS = "services/requirements"
_DOCKERFILE = "services/Dockerfile"
_DATA = ("schemas", "templates", "tests_registry")
"""What DoDo has beside its package and the services."""
_FIRMWARE, _RIG = "build/firmware", ("rig-emulator", "gantry.elf", "gantry-circle.elf")
"""The emulated rig, if ``make firmware`` has built it: part of the gantry's image."""


def assemble(folder: Path, wheels: Path | None, *, whole: bool = False) -> None:
    """Copies sources, versions and wheels into an empty folder, with their dates.

    The sources are those of services, or the ``whole`` of DoDo with its data.

    The engine identifies a context by its folder's name and transfers only files whose date has changed.
    """
    root, package = package_data.root(), Path(package_data.__file__).parent
    no_bytecode = shutil.ignore_patterns("__pycache__")
    (folder / LOCK).parent.mkdir()
    shutil.copy2(root / LOCK, folder / LOCK)
    shutil.copytree(root / "services", folder / "services", ignore=no_bytecode)
    if whole:
        for name in _DATA:
            shutil.copytree(root / name, folder / name, ignore=no_bytecode)
        shutil.copytree(package, folder / "dodo_dsl", ignore=shutil.ignore_patterns("__pycache__", "_data"))
    else:
        shutil.copytree(package / "opendlv", folder / "dodo_dsl" / "opendlv", ignore=no_bytecode)
        shutil.copy2(package / "__init__.py", folder / "dodo_dsl" / "__init__.py")
    if all((root / _FIRMWARE / name).is_file() for name in _RIG):
        (folder / "rig").mkdir()
        for name in _RIG:
            shutil.copy2(root / _FIRMWARE / name, folder / "rig" / name)
    if wheels is not None:
        shutil.copytree(wheels, folder / "wheels", copy_function=_link)


def _link(source: str, target: str) -> None:
    """Hard-links a wheel, or copies it where that is impossible."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def define(
    folder: Path, images: Sequence[Image], source: str, base_image: str | None = None, docker_image: str | None = None
) -> None:
    """Writes the targets of ``docker buildx bake``, one per image; the default images are the Dockerfile's."""
    named = {"BASE_IMAGE": base_image, "DOCKER_IMAGE": docker_image}
    arguments = {"VERSION": __version__, "SOURCE": source} | {name: value for name, value in named.items() if value}
    targets = {
        image.name: {
            "context": ".",
            "dockerfile": _DOCKERFILE,
            "target": image.name,
            "args": arguments,
            "tags": [image.reference],
            "output": ["type=docker"],
            **({"platforms": [image.platform]} if image.platform else {}),
        }
        for image in images
    }
    definition = {"group": {"default": {"targets": list(targets)}}, "target": targets}
    (folder / DEFINITION).write_text(json.dumps(definition, indent=2), encoding="utf-8")


def default_base_image() -> str:
    """The Dockerfile's own base image."""
    for line in (package_data.root() / _DOCKERFILE).read_text(encoding="utf-8").splitlines():
        if line.startswith("ARG BASE_IMAGE="):
            return line.partition("=")[2].strip()
    raise ValueError(f"{_DOCKERFILE} names no BASE_IMAGE")
