"""dodo images: build and push images. A deployment's own services have images, too."""

import argparse
import os
import re
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from platform import machine
from typing import TextIO

from dodo_dsl import __version__
from dodo_dsl.cli import application_builds, selection
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.diagnostics import did_you_mean, has_errors, shown_path
from dodo_dsl.images import build_context, docker_command
from dodo_dsl.images.docker_command import DockerError
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import Manifest, load_manifests

EXAMPLES = """examples:
  dodo images build                                   all images, named as in dodo.yml
  dodo images build collision virtual-camera          two images
  dodo images build smoothness                        that of your own service, from the Dockerfile next to its manifest
  dodo images build dodo                              DoDo itself with all that it runs, for jobs of a pipeline
  dodo images build --offline-wheels                  if a build cannot reach the package index
  dodo images push --platform linux/amd64,linux/arm64 --prefix registry.example.org/dodo
  dodo images builds --push registry.example.org/car  the application's own, checked
"""
SANDBOX = "sandbox"
SHARED = ("base", "geometry", "vision")
"""What applications and services may use as base images."""
DODO = "dodo"
"""DoDo itself, for a pipeline's jobs: no test needs it, so it is built and pushed only where it is named."""
_FOR_X86 = ("ros-bridge",)
"""There are no wheels of cyclonedds for other machines."""
_BASE = "DODO_BASE"
_DEFAULT = re.compile(rf"^\s*ARG\s+{_BASE}=[\"']?(?:\S*/)?(?P<name>[\w-]+)(?::\S*)?\s*$", re.MULTILINE | re.I)
_INDEX_HINT = "; if a build cannot reach the package index, --offline-wheels downloads the packages on this machine"


def add(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    _add_build(actions.add_parser("build", help="build images from the installed DoDo"))
    text = "build images, and push them to their registry; log in with 'docker login' first"
    _add_build(actions.add_parser("push", help=text, description=text))
    text = "build and push the application's images, from checked builds"
    application_builds.add(actions.add_parser("builds", help=text, description=text))


def _add_build(action: argparse.ArgumentParser) -> None:
    text = "services, sandbox, base, geometry, vision or dodo (default: all but dodo)"
    action.add_argument("name", nargs="*", metavar="NAME", help=text)
    for option, metavar, text in (
        ("prefix", "P", "prefix of the images' names (default: images.prefix of dodo.yml, or dodo)"),
        ("tag", "T", "tag of the images (default: images.tag of dodo.yml, or the version)"),
        ("base-image", "I", "base image with Python (default: a python:*-slim)"),
    ):
        action.add_argument(f"--{option}", metavar=metavar, default="", help=text)
    action.add_argument(
        "--platform", type=lambda text: text.split(","), default=[], metavar="P,...",
        help="machines that the images are for, such as linux/arm64 (default: the engine's); several take a builder of "
        "the driver docker-container, or an engine with containerd's image store",
    )  # fmt: skip
    text = "download packages on this machine, not in the build"
    action.add_argument("--offline-wheels", action="store_true", help=text)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    if options.action == "builds":
        return application_builds.push(options, stdout, stderr)
    deployment = selection.checked_deployment()
    options.prefix = (options.prefix or deployment.image_prefix).rstrip("/")
    options.tag = options.tag or deployment.image_tag
    if options.action == "push" and options.prefix == Deployment.image_prefix:
        raise UsageError("no registry; name it with --prefix or as images.prefix in dodo.yml")
    shipped = known(load_manifests()[0].values())
    own = _dockerfiles(deployment, shipped)
    names = _chosen(options, shipped, own)
    _bake([name for name in names if name not in own], options, stdout)
    for name in names:
        if name in own:
            _build_own(name, own[name], options)
    done = "pushed" if options.action == "push" else "built"
    stdout.writelines(f"{done} {_reference(name, options)}\n" for name in names)
    return Exit.OK


def known(manifests: Iterable[Manifest]) -> tuple[str, ...]:
    """The images of DoDo's. A service with a complete reference (``registry.example.org/radar:1``) has none of them."""
    return (*SHARED, *sorted({SANDBOX, *_FOR_X86, *(m.image for m in manifests if m.has_own_image)}))


def _reference(name: str, options: argparse.Namespace) -> str:
    return f"{options.prefix}/{name}:{options.tag}"


def _flag(options: argparse.Namespace) -> str:
    return "--push" if options.action == "push" else "--load"


def _dockerfiles(deployment: Deployment, shipped: Sequence[str]) -> dict[str, Path]:
    """The Dockerfiles beside the manifests of the deployment's services; raises UsageError if one has problems."""
    manifests, problems = load_manifests(tuple(deployment.services))
    if has_errors(problems):
        files = ", ".join(sorted({shown_path(problem.span.file) for problem in problems}))
        raise UsageError(f"problems in {files}; dodo compile --check shows them")
    own = sorted((m.image, m.folder / "Dockerfile") for m in manifests.values() if m.has_own_image)
    return {image: file for image, file in own if image not in shipped and file.is_file()}


def _chosen(options: argparse.Namespace, shipped: Sequence[str], own: Mapping[str, Path]) -> list[str]:
    """The wanted images, in the order in which layers are shared; own ones come last, as they stand on others."""
    everything = [*shipped, *own, DODO]
    for name in options.name:
        if name not in everything:
            hint = did_you_mean(name, everything) or f"known: {', '.join(sorted(everything))}"
            raise UsageError(f"there is no image '{name}', nor a Dockerfile next to its service.yml; {hint}")
    if options.name:
        return [name for name in everything if name in options.name]
    machines = options.platform or [{"x86_64": "linux/amd64", "AMD64": "linux/amd64"}.get(machine(), machine())]
    return [name for name in everything[:-1] if name not in _FOR_X86 or "linux/amd64" in machines]


def _bake(names: Sequence[str], options: argparse.Namespace, stdout: TextIO) -> None:
    """Builds images of DoDo's by their bake file; raises DockerError."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for number, name in enumerate(names):  # the first alone, so that the others find its layers
        platforms = ["linux/amd64"] if name in _FOR_X86 and len(options.platform) > 1 else options.platform
        groups.setdefault(("first" * (not number), ",".join(platforms)), []).append(name)
    variables = {"PREFIX": options.prefix, "TAG": options.tag, "VERSION": __version__, "BASE_IMAGE": options.base_image}
    with tempfile.TemporaryDirectory(prefix="dodo-images-") as place:
        folder = Path(place) / "dodo-images"
        build_context.assemble(folder)
        if options.offline_wheels and names:
            _download(options, folder / "wheels", stdout)
        for (_, platform), part in groups.items():
            words = ["buildx", "bake", "--file", build_context.BAKE, _flag(options)]
            words += ["--set", f"*.platform={platform}"] if platform else []
            if not docker_command.show(*words, *part, folder=folder, variables=variables):
                hint = "" if options.offline_wheels else _INDEX_HINT
                raise DockerError(f"docker buildx bake failed; the output above says why{hint}")


def _download(options: argparse.Namespace, folder: Path, stdout: TextIO) -> None:
    image = options.base_image or build_context.default_base_image()
    for platform in options.platform or [""]:
        minor, processor = build_context.python_of(image, platform)
        stdout.write(f"downloading packages for Python 3.{minor} on {processor} with pip\n")
        stdout.flush()
        build_context.download((minor, processor), folder)


def _build_own(name: str, dockerfile: Path, options: argparse.Namespace) -> None:
    """Builds an image; the context is the folder above that of all services. Raises DockerError."""
    match = _DEFAULT.search(dockerfile.read_text(encoding="utf-8", errors="replace"))
    base = _reference(match["name"] if match and match["name"] in SHARED else SHARED[0], options)
    words = ["buildx", "build", _flag(options), "--file", str(dockerfile), "--tag", _reference(name, options)]
    words += ["--build-arg", f"{_BASE}={base}"]
    words += ["--platform", ",".join(options.platform)] if options.platform else []
    if not docker_command.show(*words, os.fspath(dockerfile.resolve().parents[2])):
        raise DockerError(f"{shown_path(str(dockerfile))} cannot be built on {base}; the output above says why")
