"""What ``dodo new`` finds out about an application that is there: its stack, its pictures, and what its sources say.

Sources only say so much: messages that are sent under names of requests, those that are listened for, and a CID that is
built in. What they do not say is left to the user.
"""

import contextlib
import itertools
import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.application import stack
from dodo_dsl.application.application_problems import on_other_buses, takes_cid, written_cids
from dodo_dsl.application.merge import is_local
from dodo_dsl.application.model import ApplicationSource, ComposeService
from dodo_dsl.application.opendlv_flags import pictures_of
from dodo_dsl.application.read import as_written
from dodo_dsl.opendlv import regular_file
from dodo_dsl.spec.manifest import load_manifests

_FORMATS = {"argb": "video0.argb", "i420": "video0.i420", "bgr": "", "rgb": ""}
"""Formats of pictures, with the names that services give them by default."""
_SUFFIXES = (".cpp", ".cc", ".cxx", ".c", ".hpp", ".h", ".py")
_MOST_FOLDERS, _MOST_FILES, _MOST_BYTES = 20_000, 200, 200_000
"""Folders that are searched, and sources that are read; the generated headers with all messages are larger."""
_SKIPPED = ("build", "node_modules", "third_party", "venv")
_COMMENTS = re.compile(r"/\*.*?(?:\*/|\Z)|(?://|#(?!include))[^\n]*", re.DOTALL)
"""Also one without an end, which the search would begin again in each place."""
_MESSAGE = re.compile(r"opendlv(?:::|_|\.)proxy(?:::|_|\.)(?P<name>[A-Z][A-Za-z]+)")
_HEARD = re.compile(
    r"opendlv::proxy::([A-Z][A-Za-z]+)::ID\b"
    r"|extractMessage\s*<\s*opendlv::proxy::([A-Z][A-Za-z]+)\s*>"
    r"|(?P<variable>\b\w+)\s*=\s*[\w.]*opendlv(?:_|\.)proxy(?:_|\.)([A-Z][A-Za-z]+)\(\)\s*(?P=variable)\.(?:Parse|Merge)From"
)
"""What a program compares with a message's id, or takes out of an envelope."""
_SENDS = re.compile(r"\.\s*send\s*\(")
_CID = re.compile(r"\bOD4Session\s*(?:\w+\s*)?[({]\s*(?:cid\s*=\s*)?(?P<cid>[0-9]{1,3})\b")
_PLAIN = re.compile(r"[A-Za-z][\w.-]*", re.ASCII)
_WORDS = ("y", "n", "yes", "no", "on", "off", "true", "false", "null")


@dataclass(frozen=True)
class Pictures:
    """The pictures that an application reads: ``memories`` have their names by format, the size is in pixels."""

    service: str = ""
    memories: dict[str, str] = field(default_factory=dict)
    width: int = 640
    height: int = 480

    def parameters(self, service: str) -> dict[str, str]:
        """The memories that are not the default ones, as parameters of DoDo's ``service``, as far as it has them."""
        known = load_manifests()[0][service].parameters
        named = {f"name.{kind}": name for kind, name in self.memories.items() if name != _FORMATS[kind]}
        return {key: _item(name) for key, name in named.items() if key in known}

    @property
    def note(self) -> str:
        """What a new test takes from the application; empty if that is nothing."""
        named = ", ".join(self.memories.values())
        return f"its pictures are those of '{self.service}': {named}, {self.width}x{self.height}\n" if named else ""


def pictures(application: ApplicationSource | None) -> Pictures:
    """The pictures of the first service with a memory's name in its command, if that is none of the stack's."""
    own = {service.name for service in own_services(application)} if application else set()
    for asked in pictures_of(application) if application else ():
        if asked.service in own:
            memories: dict[str, str] = {}
            for name, kind in asked.formats.items():
                memories.setdefault(kind or "argb", name)
            size = {"width": asked.width, "height": asked.height}
            return Pictures(asked.service, memories, **{flag: value for flag, value in size.items() if value})
    return Pictures()


def own_services(application: ApplicationSource) -> Iterator[ComposeService]:
    """The services that are none of the stack's."""
    others = stack.parts(application)
    return (service for name, service in application.services.items() if name not in others)


@dataclass(frozen=True)
class Declarable:
    """What ``dodo.yml`` can say of the application in a compose file ``file``.

    ``without`` has what takes a service's place, by its name; ``services`` have the keys of x-dodo, as YAML.
    """

    file: str
    without: dict[str, str] = field(default_factory=dict)
    services: dict[str, str] = field(default_factory=dict)


def declarable(file: Path) -> Declarable | None:
    """None if the name of the file says all."""
    application = as_written(file)
    if application is None:
        return None
    without = {_item(name): part.instead for name, (_, part) in stack.parts(application).items()}
    found = {_item(service.name): _found(service, application) for service in own_services(application)}
    others = on_other_buses([cids for cids, _ in found.values()])
    without |= {
        name: f"it is on CID {', '.join(map(str, cids))}, another bus"
        for name, (cids, _) in found.items()
        if cids in others
    }
    services = {name: said for name, (_, said) in found.items() if said and name not in without}
    return Declarable(_item(file.name), without, services) if without or services else None


def _found(service: ComposeService, application: ApplicationSource) -> tuple[set[int], str]:
    """A service's CIDs, and the keys of x-dodo that its sources show and its compose file lacks."""
    context, cids = source.part(service.node, "build", "context"), written_cids(service, application)
    if service.declared or not isinstance(context, source.Scalar) or not is_local(context.text):
        return cids, ""
    if not application.paths.is_own(context.text):
        return cids, ""
    texts = list(_sources(application.folder / context.text))
    heard = {name for text in texts for match in _HEARD.finditer(text) for name in match.group(1, 2, 4) if name}
    named = {match["name"] for text in texts if _SENDS.search(text) for match in _MESSAGE.finditer(text)}
    keys = {
        "in": sorted(name for name in heard if name.endswith("Reading")),
        "out": sorted(name for name in named - heard if name.endswith("Request")),
    }
    said = [f"{key}: [{', '.join(f'opendlv.proxy.{n}' for n in names)}]" for key, names in keys.items() if names]
    built_in = [int(match["cid"]) for text in texts for match in _CID.finditer(text)]
    if built_in and not takes_cid(service):
        said.append(f"cid: {built_in[0]}")
        cids = {built_in[0]}
    return cids, f"{{{', '.join(said)}}}" if said else ""


def _sources(folder: Path) -> Iterator[str]:
    """The texts of sources without comments; those that cannot be read say nothing."""
    count = 0
    for place, folders, names in itertools.islice(os.walk(folder), _MOST_FOLDERS):
        folders[:] = sorted(name for name in folders if not name.startswith(".") and name not in _SKIPPED)
        for path in (Path(place) / name for name in sorted(names)):
            if path.suffix not in _SUFFIXES or path.is_symlink():
                continue
            count += 1
            if count > _MOST_FILES:
                return
            with contextlib.suppress(OSError):
                text = regular_file.content(path, _MOST_BYTES).decode("utf-8", "replace")
                yield _COMMENTS.sub(" ", text)


def _item(name: str) -> str:
    """A name as YAML."""
    return name if _PLAIN.fullmatch(name) and name.lower() not in _WORDS else json.dumps(name)
