"""Builds of an application's images: their names in a run, and copies of the folders that they get, without tests."""

import hashlib
import json
import os
import re
import shutil
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl.application.interpolation import escaped, filled
from dodo_dsl.run.docker.mounts import whole

REPOSITORY = "dodo-build"


def is_built(service: Mapping[str, Any]) -> bool:
    """Whether a run builds the image; one that a pipeline names by its digest is pulled."""
    return "build" in service and "@" not in str(service.get("image") or "")


def private_images(services: Mapping[str, Any], folder: Path, variables: Mapping[str, str]) -> dict[str, str]:
    """The names of built images by the services that use them, of an application in ``folder``.

    A name follows from the build and the image's name in the file, so that no application replaces another's image.
    """
    images = {name: service.get("image") or f"/{name}" for name, service in services.items()}
    named = {}
    for name, service in services.items():
        if is_built(service):
            text = filled(json.dumps([str(folder), images[name], service["build"]], sort_keys=True), variables)
            named[images[name]] = f"{REPOSITORY}:{hashlib.sha256(text.encode()).hexdigest()[:32]}"
    return {name: named[image] for name, image in images.items() if image in named}


_GIT = ".git"
_REMOTE = re.compile(r"[a-z-]+:|git@")


class HiddenContext(Exception):
    """A build asks for a folder that no application sees; the message says which."""


def own_contexts(services: Mapping[str, Any], hidden: Collection[Path], copies: Path, folder: Path) -> dict[str, Any]:
    """The services' builds with copies below ``copies``, which exists, of contexts that hold what is ``hidden``.

    Paths are relative to ``folder``. Files are links to the same content where the file system can do that. Raises
    HiddenContext, and OSError where nothing can be written.
    """
    hidden, copied = frozenset([*hidden, copies.resolve()]), dict[Path, str]()

    def copy_of(name: str, context: str) -> str:
        """The copy of a context; empty for one that is elsewhere, or holds nothing that is hidden."""
        place = Path(os.path.realpath(whole(context, folder)))
        if _REMOTE.match(context) or not place.is_dir():
            return ""
        if any(place.is_relative_to(path) for path in hidden) or _GIT in place.parts:
            raise HiddenContext(f"the build of '{name}' takes '{context}', where tests, their output or .git are kept")
        if place not in copied:
            is_whole = not any(path.is_relative_to(place) for path in hidden) and not os.path.lexists(place / _GIT)
            target = copies / str(len(copied)) / (place.name or "root")  # by this name builders find what they had
            copied[place] = "" if is_whole else _copy(place, target, hidden)
        return copied[place]

    def build(name: str, written: Mapping[str, Any]) -> dict[str, Any]:
        made, context = dict(written), str(written.get("context") or ".")
        if own := copy_of(name, context):
            made["context"] = escaped(own)
            file = str(made.get("dockerfile") or "Dockerfile")
            if "dockerfile_inline" not in made and not os.path.lexists(Path(own, file.replace("$$", "$"))):
                made["dockerfile"] = f"{escaped(whole(context, folder))}/{file}"
        if others := made.get("additional_contexts"):
            made["additional_contexts"] = {key: escaped(copy_of(name, path)) or path for key, path in others.items()}
        return made

    return {
        name: {key: service[key] for key in ("image", "platform") if service.get(key)}
        | {"build": build(name, service["build"])}
        for name, service in services.items()
    }


def _copy(place: Path, target: Path, hidden: Collection[Path]) -> str:
    def left_out(folder: str, names: Sequence[str]) -> set[str]:
        found = {name: Path(folder, name) for name in names}
        return {name for name, path in found.items() if name == _GIT or path in hidden or _is_odd(path)}

    shutil.copytree(place, target, symlinks=True, ignore=left_out, copy_function=_link)
    return str(target)


def _is_odd(path: Path) -> bool:
    """Neither a link nor a file, nor a folder that can be read."""
    return not (path.is_symlink() or path.is_file() or (path.is_dir() and os.access(path, os.R_OK | os.X_OK)))


def _link(source: str, target: str) -> None:
    """A link to the same file, or a copy; a file that nobody may read is left out, because no image could have it."""
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:
        try:
            shutil.copy2(source, target, follow_symlinks=False)
        except PermissionError:
            return
