"""Builds of an application's images: their names in a run, and copies of the folders that they get.

The names let an application's file replace no image on the engine. The copies are without tests, their output and
``.git``.
"""

import hashlib
import json
import os
import re
import shutil
import stat
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl.application.model import image_variable

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


_GIT = ".git"
_REMOTE = re.compile(r"[a-z-]+:|git@")


class HiddenContext(Exception):
    """A build asks for a folder that no application sees; the message says which."""


def own_contexts(services: Mapping[str, Any], hidden: Sequence[Path], folder: Path) -> dict[str, Any]:
    """The services' builds with copies below ``folder``, which exists, of contexts that hold what is ``hidden``.

    Services are as ``docker compose config`` shows them. Files are links to the same content where the file system can
    do that. Raises HiddenContext, and OSError where nothing can be written.
    """
    contexts = _Contexts([*hidden, folder.resolve()], folder)
    return {
        name: {key: service[key] for key in ("image", "platform") if service.get(key)}
        | {"build": contexts.build(name, service["build"])}
        for name, service in services.items()
        if service.get("build") is not None
    }


class _Contexts:
    """One copy for all builds of the same folder."""

    def __init__(self, hidden: Sequence[Path], folder: Path) -> None:
        self._hidden = frozenset(hidden)
        self._folder = folder
        self._copies: dict[Path, str] = {}

    def build(self, name: str, written: Any) -> dict[str, Any]:
        build = dict(written) if isinstance(written, dict) else {"context": written}
        context = str(build.get("context") or ".")
        if own := self._copied(name, context):
            build["context"] = own
            file = str(build.get("dockerfile") or "Dockerfile")
            if "dockerfile_inline" not in build and not os.path.lexists(Path(own, file)):
                build["dockerfile"] = str(Path(context, file))
        others = build.get("additional_contexts")
        if isinstance(others, dict):
            build["additional_contexts"] = {key: self._copied(name, str(p)) or p for key, p in others.items()}
        return build

    def _copied(self, name: str, context: str) -> str:
        """The copy of a context; empty for one that is elsewhere, or holds nothing that is hidden."""
        place = Path(os.path.realpath(context))
        if _REMOTE.match(context) or not place.is_dir():
            return ""
        if any(place.is_relative_to(path) for path in self._hidden) or _GIT in place.parts:
            raise HiddenContext(f"the build of '{name}' takes '{context}', where tests, their output or .git are kept")
        if place not in self._copies:
            is_whole = not any(path.is_relative_to(place) for path in self._hidden) and not _holds_git(place)
            self._copies[place] = "" if is_whole else self._copy(place)
        return self._copies[place]

    def _copy(self, place: Path) -> str:
        """A copy under the folder's own name, by which builders find what they got of it before."""
        target = self._folder / str(len(self._copies)) / (place.name or "root")
        shutil.copytree(place, target, symlinks=True, ignore=self._left_out, copy_function=_link)
        return str(target)

    def _left_out(self, folder: str, names: Sequence[str]) -> set[str]:
        return {name for name in names if self._is_left_out(folder, name)}

    def _is_left_out(self, folder: str, name: str) -> bool:
        path = os.path.join(folder, name)  # noqa: PTH118  (one of very many)
        if name == _GIT or Path(path) in self._hidden:
            return True
        kind = os.lstat(path).st_mode
        if stat.S_ISDIR(kind):
            return not os.access(path, os.R_OK | os.X_OK)
        return not stat.S_ISREG(kind) and not stat.S_ISLNK(kind)


def _holds_git(place: Path) -> bool:
    return os.path.lexists(place / _GIT)


def _link(source: str, target: str) -> None:
    """A link to the same file, or a copy; a file that nobody may read is left out, because no image could have it."""
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:
        try:
            shutil.copy2(source, target, follow_symlinks=False)
        except PermissionError:
            return
