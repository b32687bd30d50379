"""dodo images: build, push and pull images. A deployment's own services have images, too."""

import argparse
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl import __version__
from dodo_dsl.cli import application_builds, image_pull, selection
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.diagnostics import did_you_mean, has_errors, shown_path
from dodo_dsl.images import build_context, docker_command
from dodo_dsl.images.docker_command import DockerError
from dodo_dsl.images.names import BASE_ARGUMENT, DODO, PLATFORM, base_of, dockerfiles, known, platforms_of
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import load_manifests

EXAMPLES = """examples:
  dodo images build                                   all images, named as in dodo.yml
  dodo images build collision virtual-camera          two images
  dodo images build smoothness                        that of your own service, from the Dockerfile next to its manifest
  dodo images build dodo                              DoDo itself with all that it runs, for jobs of a pipeline
  dodo images build --offline-wheels                  if a build cannot reach the package index
  dodo images build --platform linux/arm64            for a Raspberry Pi, on another machine with QEMU
  dodo images push --prefix registry.example.org/dodo
  dodo images push --platform linux/amd64,linux/arm64 --prefix registry.example.org/dodo
  dodo images pull --for kiwi-dynamic                 on the rig's computer, before its first test
  dodo images builds --push registry.example.org/car  the application's own, checked
"""
_INDEX_HINT = "; if a build cannot reach the package index, --offline-wheels downloads the packages on this machine"


def add(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    _add_build(actions.add_parser("build", help="build images from the installed DoDo"))
    text = "build images, and push them to their registry; log in with 'docker login' first"
    _add_build(actions.add_parser("push", help=text, description=text))
    text = "pull the images that the tests of a rig need"
    image_pull.add(actions.add_parser("pull", help=text, description=text))
    text = "check the application's builds, and write them as a compose file; with --push, build and push them"
    application_builds.add(actions.add_parser("builds", help=text, description=text))


def _add_build(action: argparse.ArgumentParser) -> None:
    text = "services, sandbox, base, geometry, vision or dodo (default: all but dodo)"
    action.add_argument("name", nargs="*", metavar="NAME", help=text)
    for option, metavar, text in (
        ("prefix", "P", "prefix of the images' names (default: images.prefix of dodo.yml, or dodo)"),
        ("tag", "T", "tag of the images (default: images.tag of dodo.yml, or the version)"),
        ("base-image", "I", "base image with Python (default: a python:*-slim)"),
        ("docker-image", "I", "image that 'dodo' has the docker command from (default: a docker:*-cli)"),
        ("source", "URL", "URL of the sources, for the images' labels"),
    ):
        action.add_argument(f"--{option}", metavar=metavar, default="", help=text)
    action.add_argument(
        "--platform", type=_platforms, default=[], metavar="P,...",
        help="machines that the images are for, such as linux/arm64 (default: the engine's); several take a builder of "
        "the driver docker-container, or an engine with containerd's image store",
    )  # fmt: skip
    text = "download packages on this machine, not in the build"
    action.add_argument("--offline-wheels", action="store_true", help=text)
    action.add_argument("--sbom", action="store_true", help="let BuildKit attest what each image is made of")


def _platforms(text: str) -> list[str]:
    found = list(dict.fromkeys(text.split(",")))
    for one in found:
        if not PLATFORM.fullmatch(one):
            raise argparse.ArgumentTypeError(f"unknown platform '{one}'; write platforms as linux/amd64,linux/arm64")
    return found


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    if options.action == "pull":
        return image_pull.pull(options, stdout)
    if options.action == "builds":
        return application_builds.show(options, stdout, stderr)
    deployment = selection.checked_deployment()
    options.prefix = (options.prefix or deployment.image_prefix).rstrip("/")
    options.tag = options.tag or deployment.image_tag
    if options.action == "push" and options.prefix == Deployment.image_prefix:
        raise UsageError("no registry; name it with --prefix or as images.prefix in dodo.yml")
    shipped = known(load_manifests()[0].values())
    own = _dockerfiles(deployment, shipped)
    names = _chosen(options.name, shipped, own)
    files = {name: _dockerfile(name, own[name], options) for name in names if name in own}
    docker_command.require()
    _bake([name for name in names if name not in own], options, stdout)
    for name, file in files.items():
        _build_own(name, file, options)
    done = "pushed" if options.action == "push" else "built"
    for reference in (_reference(name, options) for name in names):
        is_there = docker_command.is_local(reference)
        size = f"  {docker_command.size(reference) / 1e6:.0f} MB" if is_there else ""
        stdout.write(f"{done} {reference}{size}\n")
    return Exit.OK


def _reference(name: str, options: argparse.Namespace) -> str:
    return f"{options.prefix}/{name}:{options.tag}"


def _flags(options: argparse.Namespace) -> list[str]:
    return ["--push" if options.action == "push" else "--load", *["--sbom=true"] * options.sbom]


def _dockerfiles(deployment: Deployment, shipped: Sequence[str]) -> dict[str, Path | None]:
    """The Dockerfiles of the deployment's own images; raises UsageError if a manifest has problems."""
    if not deployment.services:
        return {}
    manifests, problems = load_manifests(tuple(deployment.services))
    if has_errors(problems):
        files = ", ".join(sorted({shown_path(problem.span.file) for problem in problems}))
        raise UsageError(f"problems in {files}; dodo compile --check shows them")
    return dockerfiles(manifests.values(), shipped)


def _chosen(names: Sequence[str], shipped: Sequence[str], own: Mapping[str, Path | None]) -> list[str]:
    """The images of DoDo's that are wanted, in the order in which layers are shared, and after them the others.

    Those of own services without a Dockerfile are only chosen by name.
    """
    everything = [*shipped, *own]
    for name in names:
        if name not in [*everything, DODO]:
            hint = did_you_mean(name, [*everything, DODO]) or f"known: {', '.join(sorted(everything))}"
            raise UsageError(f"there is no image '{name}'; {hint}")
    if names:
        return [name for name in [*everything, DODO] if name in names]
    return [*shipped, *(name for name, file in own.items() if file)]


def _bake(names: Sequence[str], options: argparse.Namespace, stdout: TextIO) -> None:
    """Builds images of DoDo's by their bake file; raises DockerError, WheelsError."""
    if not names:
        return
    wheels = [*_wheels(options, stdout)] if options.offline_wheels else []
    variables = {"PREFIX": options.prefix, "TAG": options.tag, "VERSION": __version__, "SOURCE": options.source}
    variables |= {"BASE_IMAGE": options.base_image, "DOCKER_IMAGE": options.docker_image}
    groups: dict[tuple[str, ...], list[str]] = {}
    for number, name in enumerate(names):
        fitting = platforms_of(name, options.platform, is_named=bool(options.name))
        if fitting is not None:
            groups.setdefault(("first" * (not number), *fitting), []).append(name)
    with tempfile.TemporaryDirectory(prefix="dodo-images-") as place:
        folder = Path(place) / "dodo-images"
        build_context.assemble(folder, wheels)
        for (_, *platforms), part in groups.items():  # the first alone, so that the others find its layers
            words = ["buildx", "bake", "--file", build_context.BAKE, *_flags(options)]
            words += ["--set", f"*.platform={','.join(platforms)}"] if platforms else []
            if not docker_command.show(*words, *part, folder=folder, variables=variables):
                hint = "" if wheels else _INDEX_HINT
                raise DockerError(f"docker buildx bake failed; the output above says why{hint}")


def _wheels(options: argparse.Namespace, stdout: TextIO) -> Iterator[Path]:
    image = options.base_image or build_context.default_base_image()
    for platform in options.platform or [""]:
        python = build_context.python_of(image, platform)
        stdout.write(f"downloading packages for Python 3.{python.minor} on {python.machine} with pip\n")
        stdout.flush()
        yield build_context.provide_wheels(python, build_context.cache_folder())


def _dockerfile(name: str, dockerfile: Path | None, options: argparse.Namespace) -> Path:
    """The Dockerfile of an own image; raises UsageError if there is none."""
    if dockerfile is None:
        raise UsageError(
            f"there is no Dockerfile next to the service.yml of '{name}': write one there, or build "
            f"{_reference(name, options)} from your own Dockerfile on {_reference('base', options)}"
        )
    return dockerfile


def _build_own(name: str, dockerfile: Path, options: argparse.Namespace) -> None:
    """Builds an image; the context is the folder above that of all services. Raises DockerError."""
    base = _reference(base_of(dockerfile), options)
    words = ["buildx", "build", *_flags(options), "--file", str(dockerfile), "--tag", _reference(name, options)]
    words += ["--build-arg", f"{BASE_ARGUMENT}={base}"]
    words += ["--platform", ",".join(options.platform)] if options.platform else []
    if not docker_command.show(*words, os.fspath(dockerfile.resolve().parents[2])):
        raise DockerError(f"{shown_path(str(dockerfile))} cannot be built on {base}; the output above says why")
