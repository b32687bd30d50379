"""Flags that are almost ``--cid=`` or ``--name=``, which programs leave unread without a word."""

import re
from collections.abc import Iterator

from dodo_dsl import source
from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.model import ComposeService, text
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Scalar

_FLAG = re.compile(r"(?P<flag>-{1,2}[ ]?[A-Za-z]+ ?)=(?P<value> ?.*)", re.DOTALL)
_IN_ONE_WORD = re.compile(r"--cid[ ]+(?P<value>[^ ]+)")
_LITERAL = re.compile(r"--cid=(?P<value>[\w.+-]+)")
_HIGHEST = 254
_SHORT = 3
"""Letters of a flag that others differ from by one, such as ``--pid`` and ``--id``."""
COMMANDS = ("x-dodo-process", "entrypoint", "command")

Word = tuple[str, Scalar]


def words(service: ComposeService) -> Iterator[Word]:
    """The words of a service's commands, each with the value in which it is written."""
    for key in COMMANDS:
        node = service.node.get(key)
        for item in node.items if isinstance(node, source.Sequence) else (node,):
            if isinstance(item, Scalar):
                yield from ((word, item) for word in ((text(item.value),) if item is not node else _split(item.text)))


def _split(command: str) -> tuple[str, ...]:
    try:
        return opendlv_flags.split(command)
    except ValueError:
        return ()  # reported with the application


def meant(word: str, flag: str) -> str:
    """The flag with its value for a word that is almost it; empty for any other, and for the flag itself.

    Almost is one letter too many, letters in another order or size, and hyphens or blanks; for a long flag also one
    letter too few or another one.
    """
    match = _FLAG.fullmatch(word)
    if match is None or match["flag"] == flag:
        return ""
    name, wanted = match["flag"].replace("-", "").strip(), flag.removeprefix("--")
    return f"{flag}={match['value'].strip()}" if _is_near(name.lower(), wanted) else ""


def _is_near(word: str, wanted: str) -> bool:
    shorter, least = _shorter(word), _shorter(wanted) if len(wanted) > _SHORT else set()
    return sorted(word) == sorted(wanted) or wanted in shorter or word in least or not least.isdisjoint(shorter)


def _shorter(word: str) -> set[str]:
    """The word without one of its letters."""
    return {word[:at] + word[at + 1 :] for at in range(len(word))}


def cid_slips(service: ComposeService, takes_cid: bool) -> Iterator[Diagnostic]:
    """Words that are meant to give a CID, and give none; a service that ``takes_cid`` may have flags that are alike."""
    for word, item in words(service):
        one, literal = _IN_ONE_WORD.fullmatch(word), _LITERAL.fullmatch(word)
        if one:
            yield _warning(item, f"'{word}' is one word, which no program reads", f"write '--cid={one['value']}'")
        elif literal and not _is_cid(literal["value"]):
            yield _warning(item, f"'{word}' gives no CID, expected a number from 1 to {_HIGHEST}", "write '--cid=111'")
        elif not takes_cid and (flag := meant(word, "--cid")) and (_is_cid(flag[6:]) or "$" in flag):
            yield _warning(item, f"'{word}' is not the flag '--cid'", f"did you mean '{flag}'?")


def _is_cid(value: str) -> bool:
    return value.isascii() and value.isdigit() and 1 <= int(value) <= _HIGHEST


def _warning(item: Scalar, message: str, hint: str) -> Diagnostic:
    return Diagnostic(item.span, "application-cid", message, hint, "warning")
