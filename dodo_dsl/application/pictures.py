"""Pictures as an application's commands ask for them: the names of memories, their formats and their size."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest

from dodo_dsl.application.model import ApplicationSource, ComposeService

FORMATS = {"argb": 4.0, "bgr": 3.0, "rgb": 3.0, "i420": 1.5}
"""Bytes a pixel, by the format."""
_FLAG = re.compile(r"--(?P<flag>name|width|height)(?:\.(?P<format>\w+))?(?:=(?P<value>.+))?", re.DOTALL)


@dataclass(frozen=True)
class AskedPictures:
    """What a service of an application asks for; ``formats`` by the memory's name, empty if nothing says one.

    ``width`` and ``height`` in pixels, 0 if they are not given.
    """

    service: str
    formats: Mapping[str, str]
    width: int = 0
    height: int = 0


def pictures_of(application: ApplicationSource) -> list[AskedPictures]:
    """Of each service that asks for a memory."""
    found = (_of(service) for service in application.services.values())
    return [each for each in found if each.formats]


def _of(service: ComposeService) -> AskedPictures:
    formats, sizes = dict[str, str](), {"width": 0, "height": 0}
    for flag, format_, value in _flags([word for word, _ in service.words]):
        if flag == "name" and "$" not in value:
            name = value.removeprefix("/")
            ending = name.rpartition(".")[2]
            formats[name] = next((said for said in (format_, ending) if said in FORMATS), "")
        elif flag != "name" and value.isascii() and value.isdigit():
            sizes[flag] = int(value[:6])
    return AskedPictures(service.name, formats, **sizes)


def _flags(words: list[str]) -> Iterator[tuple[str, str, str]]:
    """Flags, formats and values, of ``--width=640`` and of ``--width 640``."""
    for word, following in zip_longest(words, words[1:], fillvalue=""):
        if match := _FLAG.fullmatch(word):
            yield match["flag"], match["format"] or "", match["value"] or following
