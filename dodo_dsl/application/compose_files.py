"""The files of an application, each read once, with their problems."""

import os
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.application.host_paths import HostPaths
from dodo_dsl.application.interpolation import dotenv, escaped, filled, literal, slip_in, without_default
from dodo_dsl.application.merge import Place, changed, normal, rebased, relocated
from dodo_dsl.application.secret_variables import holds_secret, is_steering
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Node, Scalar

TEST_FILLED = ("command", "entrypoint", "environment", "healthcheck")
"""The keys of a service whose variables a test may set, so that they are filled in for each test."""
_FILLED = ("services", "volumes", "networks", "secrets", "configs", "include")
"""The top-level keys below which compose fills in variables."""
_PATHS = ("build", "env_file", "extends", "volumes")
"""Those with paths of the host."""
_FOLDERS = {"PWD": ".", "HOME": "~"}
"""What variables stand for where a path starts with them."""
_FOLDER = re.compile(r"\$(?:\{(?P<braced>PWD|HOME)\}|(?P<bare>PWD|HOME)(?![A-Za-z0-9_]))(?=/|:|$)")
_LATE = ("PATH",)
_IMAGES = "DODO_IMAGE_"
"""How variables begin by which a pipeline sets images."""
MAX_FILES = 64
MAX_NODES = 50_000
MAX_TEXT = 8_192
_MAX_ENV = 1 << 20


def is_late(name: str, others: Collection[str]) -> bool:
    return name in others or name in _LATE or name.startswith(_IMAGES)


class ComposeFiles:
    """Documents with their variables filled in and paths relative to ``folder``; ``roots`` hold all of them.

    ``known`` are the variables of their ``.env`` files, and ``secrets`` those that no compiled test holds, with their
    files; ``passed`` are of DoDo's own environment. ``written`` are the texts with variables by their places.
    """

    def __init__(self, folder: Path, roots: tuple[Path, ...], passed: Collection[str] = ()) -> None:
        self.folder = folder
        self._roots = roots
        self.passed = passed
        self.problems: list[Diagnostic] = []
        self.known: dict[str, str] = {}
        self.secrets: dict[str, Path] = {}
        self.written: dict[Span, str] = {}
        self.unset: dict[Span, set[str]] = {}
        """Variables without a default, by their places, where no test can give them a value."""
        self._read: dict[Path, source.Mapping | None] = {}
        self._documents: dict[tuple[Path, Path], source.Mapping | None] = {}
        self._nodes = 0

    def filled(self, text: str, own: Mapping[str, str] | None = None, *, is_path: bool = True) -> str:
        """A text with its variables filled in, and of a path the folder or the home that it starts with.

        ``own`` are those of earlier lines of a ``.env`` file.
        """
        match = _FOLDER.match(text) if is_path else None
        text = _FOLDERS[match["braced"] or match["bare"]] + text[match.end() :] if match else text
        return filled(text, {**(own or {}), **self.known}, self.is_late)

    def is_late(self, name: str) -> bool:
        return is_late(name, (*self.passed, *self.secrets))

    @property
    def full(self) -> bool:
        return self._nodes > MAX_NODES

    def grow(self, node: Node, span: Span) -> bool:
        """Counts the values of files and of what ``extends`` makes; False, with a problem, when they are too many."""
        for part in source.walk(node):
            self._nodes += 1
            long = isinstance(part, Scalar) and len(part.text) > MAX_TEXT
            if self._nodes <= MAX_NODES and not long:
                continue
            what = (
                f"a string of more than {MAX_TEXT} characters" if long else f"more than {MAX_NODES} values in all files"
            )
            self.problems.append(Diagnostic(part.span if long else span, "too-large", what))
            return False
        return True

    def problem(self, span: Span, message: str, hint: str = "") -> None:
        self.problems.append(Diagnostic(span, "application-file", message, hint))

    def read(self, file: Path) -> source.Mapping | None:
        if file not in self._read:
            node, found = source.read(file)
            if node is None and not found:
                found = [Diagnostic(Span(str(file)), "application-file", "the file is empty, expected a compose file")]
            if node is not None and not isinstance(node, source.Mapping):
                message = "the file is not a mapping, expected a compose file with services"
                found = [*found, Diagnostic(node.span, "wrong-type", message)]
            self.problems += [problem for problem in found if problem not in self.problems]
            fits = isinstance(node, source.Mapping) and self.grow(node, Span(str(file)))
            self._read[file] = node if isinstance(node, source.Mapping) and fits else None
        return self._read[file]

    def document(self, file: Path, folder: Path) -> source.Mapping | None:
        """A file whose paths are relative to ``folder``, with them relative to the application's own folder."""
        node, key = self.read(file), (file, folder)
        if key not in self._documents:
            self._documents[key] = None if node is None else self._changed(node, folder)
        return self._documents[key]

    def _changed(self, node: source.Mapping, folder: Path) -> source.Mapping | None:
        filled = changed(node, self._filled)
        document = normal(filled) if isinstance(filled, source.Mapping) else node
        moved = document if folder == self.folder else relocated(document, self.relative(folder))
        return moved if isinstance(moved, source.Mapping) else None

    def relative(self, folder: Path) -> str:
        """A folder as seen from the application's own, as compose reads it."""
        return rebased(".", escaped(Path(os.path.relpath(folder, self.folder)).as_posix()))

    def _filled(self, word: Scalar, place: Place) -> str:
        """A text with variables filled in, but for keys of services that each test fills in, and for own keys."""
        text = str(word.value)
        if "$" not in text or not place or place[0] not in _FILLED:
            return text
        if slip := slip_in(text):
            problem = Diagnostic(word.span, "application-file", *slip)
            self.problems += [problem] if problem not in self.problems else []
        self.written[word.span] = text
        key = place[2] if place[0] == "services" and len(place) > 2 else ""
        if key in TEST_FILLED or key.startswith("x-"):
            return text
        self.unset[word.span] = without_default(text)
        return self.filled(text, is_path=place[0] != "services" or key in _PATHS)

    def other(self, word: Scalar, folder: Path) -> Path | None:
        """The file that another one in ``folder`` names; None, with a problem, when it is not one of the repository."""
        text = word.text
        if "$" in text or "://" in text or text.startswith(("/", "~", "git@", "oci:")):
            hint = "name a file of the repository, relative to this file"
            self.problem(word.span, f"'{text}' may differ between machines, expected a relative path", hint)
            return None
        file = Path(os.path.normpath(folder / text))
        if not self.holds(word, folder):
            return None
        if file.is_symlink() or not file.is_file():
            link = f"'{text}' is a symbolic link, expected a regular file"
            self.problem(word.span, link if file.is_symlink() else f"there is no file '{text}'")
            return None
        if len(self._documents) >= MAX_FILES:
            self.problem(word.span, f"the application has more than {MAX_FILES} files")
            return None
        return file

    def holds(self, word: Scalar, folder: Path) -> bool:
        problem = HostPaths(folder.resolve(), self._roots).file_problem(word.text)
        if problem:
            self.problems.append(Diagnostic(word.span, "application-isolation", problem, "keep it in the repository"))
        return not problem

    def gather(self, file: Path, taken: Collection[str] = ()) -> dict[str, str]:
        """The variables of an ``.env`` file, if there is one, without secrets, as those that are ``taken`` for one."""
        statements, problems = variables_in(file)
        self.problems += problems
        own: dict[str, str] = {}
        for name, value in statements:
            if value is None or name in self.passed:
                continue
            text = literal(self.filled(value, own))
            if text is not None and name not in taken and not holds_secret(name, text):
                own[name] = text
            elif not is_steering(name):
                self.secrets[name] = file
        return own


Statements = Sequence[tuple[str, str | None]]
"""The names and values of a file of variables, in order; None takes the value from outside."""


def variables_in(file: Path, *, raw: bool = False) -> tuple[Statements, list[Diagnostic]]:
    """What a regular file sets, and what compose refuses in it, which shows nothing of the line: it may be a secret.

    Symlinks are not followed.
    """
    if file.is_symlink() or not file.is_file():
        return [], []
    with file.open("rb") as stream:
        found, problem = dotenv(stream.read(_MAX_ENV).decode("utf-8", "replace"), raw=raw)
    if problem is None:
        return found, []
    return found, [Diagnostic(Span(str(file), problem.line, 1, 0), "application-file", problem.what, problem.hint)]
