"""What ``dodo new`` takes from a compose file that is there: what stands around the application, and its pictures."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl.application import stack
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.application.opendlv_flags import pictures_of
from dodo_dsl.application.read import as_written
from dodo_dsl.spec.manifest import load_manifests

_USUAL = {"argb": "video0.argb", "i420": "video0.i420", "width": "640", "height": "480"}
"""What cameras have by default: names of memories by format, and the size."""
_PLAIN = re.compile(r"[1-9][0-9]*|[A-Za-z][\w.-]{5,}", re.ASCII)


@dataclass(frozen=True)
class Pictures:
    """The pictures that an application reads: ``memories`` have their names by format, the size is in pixels."""

    service: str = ""
    memories: Mapping[str, str] = field(default_factory=dict)
    width: int = 640
    height: int = 480

    def parameters(self, service: str) -> dict[str, str]:
        known = load_manifests()[0][service].parameters
        wanted = {f"name.{kind}": name for kind, name in self.memories.items() if name != _USUAL.get(kind)}
        sizes = {"width": str(self.width), "height": str(self.height)}
        wanted |= {key: size for key, size in sizes.items() if size != _USUAL[key]}
        return {key: item(value) for key, value in wanted.items() if key in known}

    @property
    def note(self) -> str:
        named = ", ".join(self.memories.values())
        return f"camera settings taken from service '{self.service}': {named}, {self.width}x{self.height}\n" * bool(
            named
        )


def pictures(application: ApplicationSource | None) -> Pictures:
    """The pictures of the first service with a memory's name in its command, if that is none of the stack's."""
    others = stack.parts(application) if application else ()
    for asked in pictures_of(application) if application else ():
        if asked.service not in others:
            memories: dict[str, str] = {}
            for name, kind in asked.formats.items():
                memories.setdefault(kind or "argb", name)
            return Pictures(asked.service, memories, asked.width or 640, asked.height or 480)
    return Pictures()


def replaced(file: Path) -> dict[str, str]:
    """The services of a compose file that a test leaves out, as YAML, with what it has instead of each."""
    application = as_written(file)
    parts = stack.parts(application) if application else {}
    return {item(name): part.instead for name, (_, part) in parts.items()}


def item(text: str) -> str:
    """A name or a number as YAML, in quotation marks where it may be something else."""
    return text if _PLAIN.fullmatch(text) else json.dumps(text)
