"""OpenDLV flags in an application's command and environment: its CID, its shared memories and their pictures."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING

from dodo_dsl.application.interpolation import end_of_variable, names

if TYPE_CHECKING:
    from dodo_dsl.application.model import ApplicationSource, ComposeService

CID_VARIABLES = ("CID", "OD4SESSION_CID")

_BRACES = r"\{[^{}]*\}"
for _ in range(3):
    _BRACES = rf"\{{(?:[^{{}}]|{_BRACES})*\}}"
_VALUE = (
    rf"(?:\$*{_BRACES}|\$+\([^()]*\)|\$+[A-Za-z_]\w*|\"[^\"]*\"|'[^']*'|\\+[\"'][^\"'\\]*\\+[\"']|[\w.])"
    r"(?:\$*[\w.])*"
)
_CID = re.compile(rf"(?P<flag>(?<![\w-])--cid=)(?:{_VALUE})?|(?P<words>(?<![\w-])--cid[ \t\n]+){_VALUE}")
_MEMORY = re.compile(r"(?P<flag>--name(?:\.[A-Za-z0-9]+)?=)(?P<name>.+)", re.DOTALL)
NUMBER = re.compile(r"--(?:[\w.]+-)*cid(?:-[\w.]+)*\d?[= \t\n]+[\\\"']*(?P<cid>\d+)(?![\w.])", re.ASCII)
"""A CID as a flag's value; of those with other names, too, as ``--cid-to``."""
_PYTHON = re.compile(r"python[0-9.]+")
_ENDS = ";&|<>"


def split(command: str) -> tuple[str, ...]:
    """A command's words as compose splits them, with variables unchanged, each within one word.

    The command ends at an unquoted ``;``, ``&``, ``|``, ``<`` or ``>``, as compose starts no shell. Raises ValueError
    for an unclosed quote and for a parenthesis outside quotes.
    """
    words: list[str] = []
    word: str | None = None
    quote, place = "", 0
    while place < len(command):
        character, end = command[place], place + 1
        part = ""
        if character == "$" and quote != "'":
            end = _end_of_dollar(command, place)
            part = command[place:end]
        elif character == "\\" and quote != "'":
            end = place + 2
            part = command[place + 1 : end]
        elif character == (quote or character) and character in "\"'":
            quote = "" if quote else character
        elif quote or not (character.isspace() or character in _ENDS + "()"):
            part = character
        elif character in "()":
            raise ValueError("parenthesis outside quotes, but compose starts no shell")
        elif character in _ENDS:
            break
        else:
            words.extend(() if word is None else (word,))
            word, place = None, end
            continue
        word, place = (word or "") + part, end
    if quote:
        raise ValueError("unclosed quotation mark")
    return (*words, *(() if word is None else (word,)))


def _end_of_dollar(command: str, place: int) -> int:
    end = end_of_variable(command, place)
    if command[end : end + 1] == "(":
        closing = command.find(")", end)
        return len(command) if closing < 0 else closing + 1
    return end


def _map_flag(argv: Sequence[str], flag: str, change: Callable[[str], str]) -> tuple[str, ...]:
    """``--flag value`` in two words."""
    return tuple(change(w) if i and argv[i - 1] == flag and w[:1] != "-" else w for i, w in enumerate(argv))


def takes_cid(argv: Iterable[str], environment: Mapping[str, object]) -> bool:
    return any(_CID.search(w) or w == "--cid" or names(w) & {*CID_VARIABLES} for w in argv) or any(
        variable in environment for variable in CID_VARIABLES
    )


def arguments(process: Sequence[str], command: Sequence[str]) -> tuple[str, ...]:
    """A command behind the process that it starts itself, for an image without a program: only what follows that."""
    left, rest = ([_PYTHON.sub("python", word.rpartition("/")[2]) for word in words] for words in (process, command))
    while rest and rest[0] in left and (len(rest) < len(command) or rest[0][:1] != "-"):
        left = left[left.index(rest.pop(0)) + 1 :]
    return tuple(command[len(command) - len(rest) :])


def takes_memory(argv: Sequence[str]) -> bool:
    return any(_MEMORY.match(word) for word in argv)


def memories(argv: Iterable[str]) -> list[str]:
    return [match["name"].removeprefix("/") for word in argv if (match := _MEMORY.match(word))]


def with_cid(argv: Sequence[str], cid: int) -> tuple[str, ...]:
    """The command with ``--cid=N`` (and ``--cid N``) set."""
    return _map_flag([with_cid_text(word, cid) for word in argv], "--cid", lambda _: str(cid))


def with_cid_text(text: str, cid: int) -> str:
    """As ``with_cid``, for a command that is a single string."""
    return _CID.sub(lambda match: f"{match['flag'] or match['words']}{cid}", text)


def with_memory_prefix(argv: Sequence[str], prefix: str) -> tuple[str, ...]:
    """The command with every ``--name=X`` and ``--name.kind=X`` naming ``<prefix>X``; a leading slash stays."""

    def prefixed(match: re.Match[str]) -> str:
        return match["flag"] + memory_name(match["name"], prefix)

    return tuple(_MEMORY.sub(prefixed, word) if _MEMORY.match(word) else word for word in argv)


def memory_name(name: str, prefix: str) -> str:
    return f"/{prefix}{name[1:]}" if name.startswith("/") else prefix + name


FORMATS = {"argb": 4.0, "bgr": 3.0, "rgb": 3.0, "i420": 1.5}
"""Bytes a pixel, by the format."""
_PICTURE = re.compile(r"--(?P<flag>name|width|height)(?:\.(?P<format>\w+))?(?:=(?P<value>.+))?", re.DOTALL)


@dataclass(frozen=True)
class AskedPictures:
    """What a service of an application asks for; ``formats`` by the memory's name, empty if nothing says one.

    ``width`` and ``height`` in pixels, 0 if they are not given.
    """

    service: str
    formats: Mapping[str, str]
    width: int = 0
    height: int = 0


def pictures_of(application: "ApplicationSource") -> list[AskedPictures]:
    found = (_of(service) for service in application.services.values())
    return [each for each in found if each.formats]


def _of(service: "ComposeService") -> AskedPictures:
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
        if match := _PICTURE.fullmatch(word):
            yield match["flag"], match["format"] or "", match["value"] or following
