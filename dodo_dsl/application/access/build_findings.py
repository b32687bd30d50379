"""What the build of a service's image may not use."""

import os
import posixpath
from collections.abc import Iterator
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access.compose_keys import BUILD
from dodo_dsl.application.access.host_paths import ASK, HostPaths
from dodo_dsl.application.access.model import AccessFinding, key_findings

NETWORKS = ("", "default", "none")
_SCHEMES = ("http://", "https://", "git://", "ssh://", "git@", "github.com/", "docker-image://", "service:", "target:")
_OURS = "dodo/"
_REGISTRIES = ("index.docker.io/", "docker.io/")
_BASES = ("python", "library/python", "debian", "library/debian")
"""What DoDo's images, and those of many others, are built on."""
_WITHOUT = "is left out of sil and dil tests, which have no hardware"


def build_findings(name: str, service: dict[str, Any], paths: HostPaths) -> Iterator[AccessFinding]:
    """Files of the host, its network, privileges, and the names of DoDo's own images."""
    build = service["build"]
    image = str(service.get("image") or "")
    if short_name(image).startswith(_OURS):
        message = f"the image '{image}' of '{name}' would replace one of DoDo's own"
        yield AccessFinding((), message, "give the image another name")
    elif short_name(image) in _BASES:
        message = f"the image '{image}' of '{name}' would replace one on which others are built"
        yield AccessFinding((), message, "give the image another name")
    if isinstance(build, str):
        build = {"context": build}
        yield from (AccessFinding((), f.message, f.hint, f.kind) for f in _context(build, paths))
        return
    if not isinstance(build, dict):
        return
    yield from key_findings(f"the build of '{name}'", BUILD, build)
    yield from _context(build, paths)
    yield from _others(name, build, paths)


def short_name(image: str) -> str:
    """An image's name without tag, digest and the registry that the engine takes by default."""
    name = image.partition("@")[0]
    head, sign, tag = name.rpartition(":")
    name = head if sign and "/" not in tag else name
    for registry in _REGISTRIES:
        name = name.removeprefix(registry)
    return name


def is_remote(text: str, paths: HostPaths) -> bool:
    """Whether a context is elsewhere: of one that is a file of the repository, too, builders take that."""
    if not text.startswith(_SCHEMES) or ".." in text.split("/") or "\0" in text:
        return False
    return not any(os.path.lexists(place / text) for place in (paths.folder, *paths.roots))


def _context(build: dict[str, Any], paths: HostPaths) -> Iterator[AccessFinding]:
    context = build.get("context")
    context = context if isinstance(context, str) and context else "."
    if paths.is_open(context) or is_remote(context, paths):
        return
    if problem := _folder_problem(context, paths):
        yield AccessFinding(("context",), problem, ASK)
        return
    file = build.get("dockerfile")
    if isinstance(file, str) and file and (problem := paths.file_problem(posixpath.join(context, file), file)):
        yield AccessFinding(("dockerfile",), problem, ASK)


def _folder_problem(text: str, paths: HostPaths) -> str:
    if "://" in text:
        return f"'{text}' is of a kind that may be a file of the host"
    return paths.file_problem(text)


def _others(name: str, build: dict[str, Any], paths: HostPaths) -> Iterator[AccessFinding]:
    contexts = build.get("additional_contexts")
    for step, text in _pairs(contexts):
        if paths.is_open(text) or is_remote(text, paths):
            continue
        if text and (problem := _folder_problem(text, paths)):
            yield AccessFinding(("additional_contexts", step), problem, ASK)
    for step, text in _pairs(build.get("ssh")):
        if text and (problem := paths.file_problem(text)):
            yield AccessFinding(("ssh", step), problem, ASK)
    network = str(build.get("network") or "")
    if not paths.is_open(network) and network not in NETWORKS:
        message = f"a build of '{name}' on the network '{network}' reaches services of the host"
        yield AccessFinding(("network",), message, "remove it")
    if host_access.is_true(build.get("privileged", False)):
        yield AccessFinding(("privileged",), f"'privileged' of the build of '{name}' {_WITHOUT}", kind="privilege")


def _pairs(written: Any) -> Iterator[tuple[str | int, str]]:
    """The values of a mapping, or of a list of ``name=value``, each with its key or number."""
    if isinstance(written, dict):
        yield from ((str(key), str(value or "")) for key, value in written.items())
    elif isinstance(written, list):
        yield from ((item, str(text).partition("=")[2]) for item, text in enumerate(written))
    elif isinstance(written, str):
        yield 0, written.partition("=")[2]
