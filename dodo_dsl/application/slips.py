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
INTERPRETERS = ("python", "python3", "sh", "bash", "node", "perl", "ruby")


def _meant(word: str) -> str:
    """The value in a word that is almost ``--cid=``: letters in another order or size, one too many, or blanks."""
    match = _FLAG.fullmatch(word)
    if match is None or match["flag"] == "--cid":
        return ""
    name = match["flag"].replace("-", "").strip().lower()
    shorter = {name[:at] + name[at + 1 :] for at in range(len(name))}
    return match["value"].strip() if sorted(name) == sorted("cid") or "cid" in shorter else ""


def cid_slips(service: ComposeService, takes_cid: bool) -> Iterator[Diagnostic]:
    """Words that are meant to give a CID, and give none; a service that ``takes_cid`` may have flags that are alike."""
    for word, item in service.words:
        one, literal = _IN_ONE_WORD.fullmatch(word), _LITERAL.fullmatch(word)
        if one:
            yield _warning(item, f"'{word}' is one word, which no program reads", f"write '--cid={one['value']}'")
        elif literal and not is_cid(literal["value"]):
            yield _warning(item, f"'{word}' gives no CID, expected a number from 1 to {_HIGHEST}", "write '--cid=111'")
        elif not takes_cid and (value := _meant(word)) and (is_cid(value) or "$" in value):
            yield _warning(item, f"'{word}' is not the flag '--cid'", f"did you mean '--cid={value}'?")


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
