"""dodo images: build, push and pull images. A deployment's own services have images, too."""

import argparse
import shlex
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl import __version__, package_data
from dodo_dsl.cli import application_builds, image_pull, selection
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.diagnostics import did_you_mean, has_errors, shown_path
from dodo_dsl.images import build_context, docker_command
from dodo_dsl.images.docker_command import DockerError
from dodo_dsl.images.names import BASE_ARGUMENT, DODO, PLATFORM, Series, base_of, dockerfiles, is_for, known
from dodo_dsl.spec.deployment import Deployment, build_command
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
_INDEX_HINT = "if a build cannot reach the package index, --offline-wheels downloads the packages on this machine"


def add(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    build = _action(actions, "build", "build images from the installed DoDo")
    build.add_argument(
        "--base-image", metavar="I", default="", help="base image with Python (default: a python:*-slim)"
    )
    build.add_argument(
        "--docker-image", metavar="I", default="",
        help="image that 'dodo' has the docker command and its plugins from (default: a docker:*-cli)"
    )  # fmt: skip
    build.add_argument(
        "--offline-wheels", action="store_true", help="download packages on this machine, not in the build"
    )
    build.add_argument("--source", metavar="URL", default="", help="URL of the sources, for the images' labels")
    _action(actions, "push", "push images to their registry; log in with 'docker login' first")
    text = "pull the images that the tests of a rig need, if there is room for them"
    image_pull.add(actions.add_parser("pull", help=text, description=text))
    text = "check the application's builds, and write them as a compose file; with --push, build and push them"
    application_builds.add(actions.add_parser("builds", help=text, description=text))


def _action(
    actions: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str
) -> argparse.ArgumentParser:
    action = actions.add_parser(name, help=text, description=text)
    action.add_argument(
        "--platform", type=_platforms, default=[], metavar="P,...",
        help="machines that the images are for, such as linux/arm64 (default: the engine's); several of them have the "
        "tags T-amd64 and T-arm64, and 'push' makes T a list of these"
    )  # fmt: skip
    text = "services, sandbox, base, geometry, vision or dodo (default: all but dodo)"
    action.add_argument("name", nargs="*", metavar="NAME", help=text)
    text = "prefix of the images' names (default: images.prefix of dodo.yml, or dodo)"
    action.add_argument("--prefix", metavar="P", help=text)
    text = "tag of the images (default: images.tag of dodo.yml, or the version)"
    action.add_argument("--tag", metavar="T", help=text)
    return action


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
    series = series_of(options, deployment)
    if options.action == "push" and series.prefix == Deployment.image_prefix:
        raise UsageError("no registry; name it with --prefix or as images.prefix in dodo.yml")
    shipped = known(load_manifests()[0].values())
    own = _dockerfiles(deployment, shipped)
    names = _chosen(options.name, shipped, own)
    docker_command.require()
    if options.action == "push":
        _push(names, series, options.platform, stdout)
        return Exit.OK
    files = {name: _dockerfile(name, own[name], series) for name in names if name in own}
    for one in series.each(options.platform):
        if of_dodo := [name for name in names if name not in own and (options.name or is_for(name, one.platform))]:
            _build(options, of_dodo, one, stdout)
        for name, file in files.items():
            _build_own(name, file, one, stdout)
    return Exit.OK


def series_of(options: argparse.Namespace, deployment: Deployment) -> Series:
    """The prefix and the tag of the command line, or else of the deployment."""
    prefix = options.prefix or deployment.image_prefix
    return Series(prefix.rstrip("/"), options.tag or deployment.image_tag)


def _dockerfiles(deployment: Deployment, shipped: Sequence[str]) -> Mapping[str, Path | None]:
    """The Dockerfile of each own image, None if there is none; raises UsageError for manifests with problems."""
    if not deployment.services:
        return {}
    manifests, problems = load_manifests(deployment.services)
    if has_errors(problems):
        files = sorted({shown_path(d.span.file) for d in problems if d.severity == "error"})
        raise UsageError(f"problems in {', '.join(files)}; dodo compile --check shows them")
    return dockerfiles((m for m in manifests.values() if m.folder.parent != package_data.services()), shipped)


def _chosen(words: Sequence[str], shipped: Sequence[str], own: Mapping[str, Path | None]) -> list[str]:
    """The images with these names, those that tests need without any; raises UsageError."""
    names = (*shipped, *own, DODO)
    for word in words:
        if word not in names:
            hint = did_you_mean(word, names) or f"known: {', '.join(sorted(names))}"
            raise UsageError(f"there is no image '{word}'; {hint}")
    return [name for name in names if name in (words or [*shipped, *(name for name in own if own[name])])]


def _build(options: argparse.Namespace, names: Sequence[str], series: Series, stdout: TextIO) -> None:
    """Builds images of DoDo's, one of them alone at first, so that what all have in common is one layer."""
    wheels = None
    if options.offline_wheels:
        base = options.base_image or build_context.default_base_image()
        python = build_context.python_of(base, series.platform)
        stdout.write(f"downloading packages for Python 3.{python.minor} on {python.machine} with pip\n")
        stdout.flush()
        wheels = build_context.provide_wheels(python, build_context.cache_folder())
    variables = {"PREFIX": series.prefix, "TAG": series.tag, "VERSION": __version__, "SOURCE": options.source}
    variables |= {"BASE_IMAGE": options.base_image, "DOCKER_IMAGE": options.docker_image}
    words = ["buildx", "bake", "--file", build_context.BAKE, "--load"]
    words += ["--set", f"*.platform={series.platform}"] if series.platform else []
    with tempfile.TemporaryDirectory(prefix="dodo-images-") as name:
        folder = Path(name) / "dodo-images"
        build_context.assemble(folder, wheels)
        for part in (names[:1], names[1:]):
            if part and not docker_command.show(*words, *part, folder=folder, variables=variables):
                hint = "" if wheels else f"; {_INDEX_HINT}"
                raise DockerError(f"the images cannot be built; the output above says why{hint}")
    _say_built(names, series, stdout)


def _dockerfile(name: str, dockerfile: Path | None, series: Series) -> Path:
    """The Dockerfile of an own image; raises UsageError if there is none."""
    if dockerfile is None:
        raise UsageError(
            f"there is no Dockerfile next to the service.yml of '{name}': write one there, or build "
            f"{series.reference(name)} from your own Dockerfile on {series.reference('base')}"
        )
    return dockerfile


def _build_own(name: str, dockerfile: Path, series: Series, stdout: TextIO) -> None:
    """Builds an image; the context is the folder above that of all services.

    Raises UsageError if the image below it is missing, and DockerError.
    """
    below = base_of(dockerfile)
    base = series.reference(below)
    if series.prefix == Deployment.image_prefix and not docker_command.is_local(base):
        command = build_command(series.prefix, series.tag, below)
        raise UsageError(f"{base} is not on this machine; build it first: {command}")
    words = ["buildx", "build", "--load", "--file", str(dockerfile), "--tag", series.reference(name)]
    words += ["--build-arg", f"{BASE_ARGUMENT}={base}", *(["--platform", series.platform] if series.platform else [])]
    if not docker_command.show(*words, str(dockerfile.resolve().parents[2])):
        raise DockerError(f"{shown_path(str(dockerfile))} cannot be built on {base}; the output above says why")
    _say_built([name], series, stdout)


def _say_built(names: Sequence[str], series: Series, stdout: TextIO) -> None:
    references = [series.reference(name) for name in names]
    for reference in references:
        size = docker_command.size(reference) / 1e6
        stdout.write(f"built {reference:<{max(map(len, references))}}  {size:.0f} MB\n")


def _push(names: Sequence[str], series: Series, platforms: Sequence[str], stdout: TextIO) -> None:
    each = series.each(platforms)
    pushed = [(one, name) for one in each for name in names]
    if missing := [(one, name) for one, name in pushed if not docker_command.is_local(one.reference(name))]:
        command = build_command(series.prefix, series.tag, *dict.fromkeys(name for _, name in missing))
        command += f" --platform {shlex.quote(','.join(platforms))}" if platforms else ""
        one, name = missing[0]
        raise UsageError(f"{one.reference(name)} is not on this machine; build it first: {command}")
    for one, name in pushed:
        if one.platform and (found := docker_command.platform(one.reference(name))) != one.platform:
            raise UsageError(f"{one.reference(name)} is for {found}, not for {one.platform}")
    for number, (one, name) in enumerate(pushed, 1):
        reference = one.reference(name)
        stdout.write(f"[{number}/{len(pushed)}] {reference}\n")
        _send(("push", reference), reference)
    for name in names if len(each) > 1 else ():
        whole = series.reference(name)
        stdout.write(f"{whole}: a list of {', '.join(platforms)}\n")
        parts = [one.reference(name) for one in each]
        _send(("buildx", "imagetools", "create", "--tag", whole, *parts), whole)


def _send(words: Sequence[str], reference: str) -> None:
    if not docker_command.show(*words):
        login = f"if its registry requires a login: docker login {reference.partition('/')[0]}"
        raise DockerError(f"{reference} cannot be pushed; the output above says why; {login}")
