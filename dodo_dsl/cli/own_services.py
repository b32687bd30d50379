"""``dodo images`` for the services of a deployment that are a user's own."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl import package_data
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.diagnostics import has_errors, shown_path
from dodo_dsl.images import docker_command, own_images
from dodo_dsl.images.names import Image, known
from dodo_dsl.spec.deployment.deployment import Deployment, build_command
from dodo_dsl.spec.manifest import load_manifests

Dockerfiles = Mapping[str, Path | None]


def dockerfiles(deployment: Deployment) -> Dockerfiles:
    """The Dockerfile of each own image, None where there is none; raises UsageError for manifests with problems."""
    if not deployment.services:
        return {}
    manifests, problems = load_manifests(deployment.services)
    if has_errors(problems):
        files = sorted({shown_path(d.span.file) for d in problems if d.severity == "error"})
        raise UsageError(f"problems in {', '.join(files)}; dodo compile --check shows them")
    own = [m for m in manifests.values() if m.folder.parent != package_data.services()]
    return own_images.dockerfiles(own, known(load_manifests()[0].values()))


def require_dockerfiles(names: Collection[str], own: Dockerfiles, images: Sequence[Image]) -> None:
    """Raises UsageError where an image is named that has no Dockerfile."""
    for image in images:
        if image.name in names and own.get(image.name, Path()) is None:
            base = own_images.beside(image.reference, "base")
            raise UsageError(
                f"there is no Dockerfile beside the service.yml of '{image.name}': write one there, or build "
                f"{image.reference} from your own Dockerfile on {base}"
            )


def build(image: Image, dockerfile: Path, stdout: TextIO) -> None:
    """Builds an image; raises UsageError where the one below it is missing, and DockerError."""
    base = own_images.base_of(image, dockerfile)
    if base.startswith(f"{Deployment.image_prefix}/") and not docker_command.is_local(base):
        prefix, _, last = base.rpartition("/")
        name, _, tag = last.partition(":")
        raise UsageError(f"{base} is not on this machine; build it first: {build_command(prefix, tag, name)}")
    code, _ = docker_command.show(own_images.build_words(image, dockerfile), stdout)
    if code:
        file = shown_path(str(dockerfile))
        raise docker_command.DockerError(f"{file} cannot be built on {base}; the output above says why")
    say_built([image], stdout)


def say_built(images: Sequence[Image], stdout: TextIO) -> None:
    width = max(len(image.reference) for image in images)
    for image in images:
        stdout.write(f"built {image.reference:<{width}}  {docker_command.size(image.reference) / 1e6:.0f} MB\n")
