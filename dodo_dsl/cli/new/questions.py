"""What ``dodo new`` asks in a terminal when no name is given."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.new.starts import kinds, once, start
from dodo_dsl.spec.model import LEVEL_WORDS, Spec

_LEVELS = {**LEVEL_WORDS, "hil": f"{LEVEL_WORDS['hil']}, on a rig, at first the emulated one"}
_KINDS = {
    "closed-loop": "the application drives",
    "open-loop": "the application is carried along, and its signals are judged",
    "perception": "what the application finds in pictures is judged",
}
_NEW = "new"


@dataclass(frozen=True)
class Wanted:
    """The new test as it is asked for; ``extends`` is empty for a template."""

    name: str
    level: str = ""
    kind: str = ""
    extends: str = ""
    rec: Path | None = None


@dataclass(frozen=True)
class Questions:
    """Asks a person; an empty answer takes the choice in brackets. Raises UsageError at the end of the input."""

    stdin: TextIO
    stdout: TextIO
    check_name: Callable[[str], None]

    def ask(self, shipped: Sequence[Spec], known: Wanted) -> Wanted:
        """The test, with what is not ``known`` of it already."""
        if known.extends or known.rec:
            return replace(known, name=self._name(f"my-{known.extends}" if known.extends else "dil-first"))
        level = known.level or self._choice("level", list(_LEVELS.items()))
        kind = known.kind or self._choice("kind", [(name, _KINDS[name]) for name in kinds(level)])
        first = start(level, kind)
        copies = [spec for spec in once(shipped) if (spec.level, spec.kind) == (level, kind)]
        copies.sort(key=lambda spec: spec.name != first.shipped)
        own = [] if first.shipped else [(_NEW, "a short test to change")]
        chosen = self._choice("begin with", [*own, *((spec.name or "", spec.description or "") for spec in copies)])
        return Wanted(self._name(f"{level}-first"), level, kind, "" if chosen == _NEW else chosen)

    def _choice(self, what: str, rows: Sequence[tuple[str, str]]) -> str:
        width = max(len(name) for name, _ in rows)
        lines = [f"  {number}  {name.ljust(width)}  {text}\n" for number, (name, text) in enumerate(rows, 1)]
        self.stdout.write(f"{what}\n" + "".join(lines))
        names = [name for name, _ in rows]
        while True:
            answer = self._answer("number or name [1]: ") or "1"
            if answer in names:
                return answer
            if answer.isascii() and answer.isdigit() and 1 <= int(answer[:6]) <= len(names):
                return names[int(answer) - 1]
            self.stdout.write(f"'{answer}' is none of them, expected a number from 1 to {len(names)}\n")

    def _name(self, usual: str) -> str:
        while True:
            name = self._answer(f"name [{usual}]: ") or usual
            try:
                self.check_name(name)
            except UsageError as error:
                self.stdout.write(f"{error}\n")
            else:
                return name

    def _answer(self, prompt: str) -> str:
        self.stdout.write(prompt)
        self.stdout.flush()
        line = self.stdin.readline()
        if not line:
            self.stdout.write("\n")
            raise UsageError("nothing was written, as the input ended before all was answered")
        return line.strip()
