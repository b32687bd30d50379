"""What people hardly mean, though it is a compose file: variables, flags and programs that are almost right."""

import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.application.model import ComposeService
from dodo_dsl.diagnostics import Diagnostic, shown_path
from dodo_dsl.source import Scalar

_FLAG = re.compile(r"(?P<flag>-{1,2}[ ]?[A-Za-z]+ ?)=(?P<value> ?.*)", re.DOTALL)
_IN_ONE_WORD = re.compile(r"--cid[ ]+(?P<value>[^ ]+)")
_LITERAL = re.compile(r"--cid=(?P<value>[\w.+-]+)")
_HIGHEST = 254
_SHORT = 3
"""Letters of a flag that others differ from by one, such as ``--pid`` and ``--id``."""

INTERPRETERS = ("python", "python3", "sh", "bash", "node", "perl", "ruby")


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
    for word, item in service.words:
        one, literal = _IN_ONE_WORD.fullmatch(word), _LITERAL.fullmatch(word)
        if one:
            yield _warning(item, f"'{word}' is one word, which no program reads", f"write '--cid={one['value']}'")
        elif literal and not is_cid(literal["value"]):
            yield _warning(
                item,
                f"'{word}' gives no CID, expected a number from 1 to {_HIGHEST}",
                "write '--cid=111'",
            )
        elif not takes_cid and (flag := meant(word, "--cid")) and (is_cid(flag[6:]) or "$" in flag):
            yield _warning(item, f"'{word}' is not the flag '--cid'", f"did you mean '{flag}'?")


def is_cid(value: str) -> bool:
    """Whether a text is a whole number from 1 to 254."""
    return value.isascii() and value.isdigit() and len(value) < 9 and 1 <= int(value) <= _HIGHEST


def _warning(item: Scalar, message: str, hint: str) -> Diagnostic:
    return Diagnostic(item.span, "application-cid", message, hint, "warning")


def missing_program(service: ComposeService, folder: Path) -> Iterator[Diagnostic]:
    """Warnings of the program and its script, which are seen from the compose file's ``folder``."""
    process = service.node.get("x-dodo-process")
    items = process.items if isinstance(process, source.Sequence) else ()
    words = [word for word in items if isinstance(word, Scalar)]
    if not words or "$" in words[0].text:
        return
    program = words[0]
    if program.text in INTERPRETERS:
        yield from _missing_script(program.text, words[1:], folder)
    elif " " in program.text.strip() and not (folder / program.text).exists():
        parts = ", ".join(program.text.split())
        yield _cannot_start(program, f"there is no program '{program.text}', which is one word", f"write [{parts}]")
    elif "/" in program.text:
        own = folder / program.text
        if own.is_file() and not os.access(own, os.X_OK):
            hint = f"run: chmod +x {shlex.quote(shown_path(str(own)))}"
            yield _cannot_start(program, f"'{program.text}' is not executable", hint)
        elif not own.exists() and "build" not in service.node.entries:  # which a pipeline's check never sees
            yield _cannot_start(program, f"there is no program '{program.text}'", "build it first")


def _missing_script(interpreter: str, words: list[Scalar], folder: Path) -> Iterator[Diagnostic]:
    name = words[0].text if words else ""
    if name and not name.startswith("-") and "$" not in name and not (folder / name).is_file():
        hint = "without it the application starts in containers only"
        yield _cannot_start(words[0], f"there is no file '{name}' for {interpreter} to run", hint)


def _cannot_start(word: Scalar, message: str, hint: str) -> Diagnostic:
    return Diagnostic(word.span, "application-file", message, hint, "warning")
