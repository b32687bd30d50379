"""A part of a compose file while it is read: its fields and texts, and the problems at their places."""

import posixpath
from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING

from dodo_dsl import source
from dodo_dsl.application.interpolation import escaped, literal
from dodo_dsl.application.model import plain, text
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean
from dodo_dsl.source import Node, Scalar
from dodo_dsl.spec.sandbox_limits import SandboxLimits

if TYPE_CHECKING:
    from dodo_dsl.application.construction import Construction

ASK_KEY = "your own keys begin with x-, such as x-{}; docs/reference/sandbox.md has compose's"

OFF: tuple[object, ...] = (None, False, "", "false", [], {})
"""Values of keys that say nothing."""
Refused = tuple[str, ...]
"""Why a key is refused, what to write instead, and the values that are not."""
NOTHING: Mapping[str, Refused] = {}


class Part:
    """A service, a volume, a secret or a config, by its ``name``; ``span`` is the place of its key."""

    def __init__(self, project: "Construction", name: str, span: Span, problems: list[Diagnostic]) -> None:
        self.project, self.name, self.span, self.problems = project, name, span, problems
        self.left: list[tuple[str, Span]] = []
        """The keys that a test does not carry, each with its place."""

    @property
    def limits(self) -> SandboxLimits:
        return self.project.setting.limits

    def add(self, problem: Diagnostic) -> None:
        self.problems.append(problem)

    def bad(self, span: Span, message: str, hint: str = "") -> None:
        self.add(Diagnostic(span, "application-file", message, hint))

    def refuse(self, span: Span, message: str, hint: str) -> None:
        """Access to the host that tests would share."""
        self.add(Diagnostic(span, "application-isolation", message, hint))

    def hardware(self, span: Span, message: str, hint: str = "test it on a rig (level hil)") -> None:
        """What only rigs have, and other tests leave out."""
        self.add(Diagnostic(span, "application-hardware", message, hint, "warning"))

    def cut(self, span: Span, what: str, most: float, key: str = "") -> None:
        """A limit beyond ``most``, which takes its place; ``key`` of ``sandbox`` sets it, if one does."""
        hint = f"it is cut; '{key}' of 'sandbox' in dodo.yml sets the limit" if key else "it is cut"
        message = f"'{what}' of {self.name} is beyond the test's limit of {most:,g}"
        self.add(Diagnostic(span, "application-limit", message, hint, "warning"))

    def unknown_key(self, key: str, of: source.Mapping, where: str, known: Collection[str], hint: str = "") -> None:
        """A key of a mapping that compose has not; one with x- is somebody's own."""
        if not key.startswith("x-"):
            hint = hint or did_you_mean(key, known) or ASK_KEY.format(key)
            message = f"unknown key '{key}' in {where}"
            self.add(Diagnostic(of.entries[key].key, "unknown-key", message, hint))

    def literal(self, node: Node) -> str | None:
        """A text that is known when the test is compiled; None for any other, with a problem."""
        if not isinstance(node, Scalar):
            self.add(Diagnostic(node.span, "wrong-type", f"a list or a mapping in '{self.name}', expected a text"))
            return None
        if node.value is None:
            return None
        found = literal(text(plain(node)))
        if found is None and "?" not in node.text:
            message = f"'{node.text}' has a variable whose value is not known when the test is compiled"
            self.bad(
                node.span,
                message,
                "write the value here, or set it in .env under a name that does not look like a secret",
            )
        return found

    def path(self, found: str | None, span: Span, *, base: str = "") -> str | None:
        """A file or folder of the repository as a compiled file has it; None for any other, with a problem."""
        if found is None:
            return None
        if problem := self.project.paths.file_problem(posixpath.join(base, found), found):
            self.refuse(span, problem, "keep it in the repository, or allow it with 'paths' in dodo.yml")
            return None
        self.project.show(found, span)
        return escaped(self.project.rebased(found))

    def items(self, node: Node) -> Iterator[Node]:
        yield from (i for i in (node.items if isinstance(node, source.Sequence) else (node,)) if is_set(i))

    def fields(
        self, node: Node | None, what: str, known: str, left_out: str = "", refused: Mapping[str, Refused] = NOTHING
    ) -> dict[str, Node]:
        """The fields of a mapping that a test carries; problems of those that it cannot have, and of unknown ones."""
        found: dict[str, Node] = {}
        words, gone = known.split(), left_out.split()
        for key, entry in source.entries(node).items():
            if key in words:
                found.update({key: entry.value} if is_set(entry.value) else {})
            elif key in refused:
                found.update({} if self.is_refused(key, entry, what, refused[key]) else {key: entry.value})
            elif key in gone:
                self.left.append((key, entry.key))
            elif isinstance(node, source.Mapping):
                self.unknown_key(key, node, what, (*words, *gone, *refused))
        return found

    def is_refused(self, key: str, entry: source.Entry, what: str, refused: Refused) -> bool:
        """Whether a key says anything but a value that a test has; a problem where something else would run."""
        why, fix, *allowed = refused
        if plain(entry.value) in allowed:
            return False
        if plain(entry.value) not in OFF:
            self.refuse(spot(entry), f"'{key}' of {what} {why}", fix)
        return True


def spot(entry: source.Entry) -> Span:
    """The place of a value, or of the first of a list; of a mapping that of its key."""
    node = entry.value
    if isinstance(node, source.Sequence) and node.items:
        return node.items[0].span
    return node.span if isinstance(node, Scalar) and node.text else entry.key


def is_set(node: Node) -> bool:
    return not (isinstance(node, Scalar) and node.value is None)
