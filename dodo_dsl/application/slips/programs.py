"""Programs of ``x-dodo-process`` that cannot start here; they may be in the PATH of another machine."""

import os
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.application.model import ComposeService
from dodo_dsl.diagnostics import Diagnostic, closest, did_you_mean, shown_path
from dodo_dsl.source import Scalar

INTERPRETERS = ("python", "python3", "sh", "bash", "node", "perl", "ruby")
_SCRIPTS = {".py": "python", ".sh": "sh", ".js": "node", ".pl": "perl", ".rb": "ruby"}


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
        yield from _wrong_path(program, folder, is_built="build" in service.node.entries)
    elif not shutil.which(program.text):
        yield from _not_in_path(program, folder)


def _wrong_path(program: Scalar, folder: Path, is_built: bool) -> Iterator[Diagnostic]:
    """A service that ``is_built`` as an image has a program that a pipeline's check never sees."""
    own = folder / program.text
    if own.is_file() and not os.access(own, os.X_OK):
        hint = f"run: chmod +x {shlex.quote(shown_path(str(own)))}"
        yield _cannot_start(program, f"'{program.text}' is not executable", hint)
    elif not own.exists():
        beside = own.parent.iterdir() if own.parent.is_dir() else ()
        near = closest(own.name, [path.name for path in beside if os.access(path, os.X_OK)])
        meant = f"did you mean '{program.text.removesuffix(own.name)}{near[0]}'?" if near else ""
        if near or not is_built:
            yield _cannot_start(program, f"there is no program '{program.text}'", meant or "build it first")


def _not_in_path(program: Scalar, folder: Path) -> Iterator[Diagnostic]:
    """A program in the PATH of another machine is none of the files here, and not spelt like an interpreter."""
    suffix = Path(program.text).suffix
    if (folder / program.text).is_file():
        how = [f"[{_SCRIPTS[suffix]}, {program.text}]"] if suffix in _SCRIPTS else []
        hint = " or ".join([*how, f"./{program.text}"])
        yield _cannot_start(program, f"there is no program '{program.text}' in the PATH", f"write {hint}")
    elif near := closest(program.text, INTERPRETERS):
        yield _cannot_start(program, f"there is no program '{program.text}'", f"did you mean '{near[0]}'?")


def _missing_script(interpreter: str, words: list[Scalar], folder: Path) -> Iterator[Diagnostic]:
    name = words[0].text if words else ""
    if name and not name.startswith("-") and "$" not in name and not (folder / name).is_file():
        beside = [path.name for path in folder.iterdir() if path.suffix == Path(name).suffix]
        hint = did_you_mean(Path(name).name, beside) or "without it the application starts in containers only"
        yield _cannot_start(words[0], f"there is no file '{name}' for {interpreter} to run", hint)


def _cannot_start(word: Scalar, message: str, hint: str) -> Diagnostic:
    return Diagnostic(word.span, "application-file", message, hint, "warning")
