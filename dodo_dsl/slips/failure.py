"""Where a parser gave up, and what that means."""

import functools
import re
from dataclasses import dataclass
from typing import Any

import yaml

from dodo_dsl.diagnostics import Fix

KEY = re.compile(r"\s*(?:- )?(?P<key>[A-Za-z_][\w.-]*):(?:\s+(?P<value>.*))?$")
PLAIN_KEY = re.compile(r"[a-z][a-z0-9-]*")
BLOCK_STYLES = ("|", ">")
VALUES = "mapping values are not allowed"
"""The words about a colon where a value cannot have one."""

Mark = tuple[int, int]
"""Line and column, from 0."""


@dataclass(frozen=True)
class Slip:
    """A mistake in a text: its place, counted from 0, and words about it; ``is_tab`` for indentation with a tab.

    ``fix`` is for the ``length`` characters at the place, where there is exactly one fix.
    """

    line: int
    column: int
    message: str
    hint: str = ""
    is_tab: bool = False
    fix: Fix | None = None
    length: int = 1


@dataclass(frozen=True)
class Failure:
    """``problem`` and ``context`` are libyaml's words; ``begin`` is where it began to read what failed at ``mark``."""

    text: str
    problem: str
    mark: Mark
    context: str
    begin: Mark | None
    loader: Any

    @functools.cached_property
    def lines(self) -> list[str]:
        """The lines of the text, empty within a block text, below ``|`` or ``>``, where anything may stand."""
        found = self.text.splitlines()
        for token in self.tokens:
            if isinstance(token, yaml.ScalarToken) and token.style in BLOCK_STYLES:
                end = token.end_mark.line + bool(token.end_mark.column)
                for number in range(token.start_mark.line + 1, min(end, len(found))):
                    found[number] = ""
        return found

    def line(self, number: int) -> str:
        return self.lines[number] if 0 <= number < len(self.lines) else ""

    @property
    def here(self) -> str:
        """The rest of the line from the mark on."""
        return self.line(self.mark[0])[self.mark[1] :]

    @property
    def before(self) -> str:
        """The line up to the mark."""
        return self.line(self.mark[0])[: self.mark[1]]

    def above(self, number: int) -> int:
        """The nearest line above that is neither empty nor a comment; -1 when there is none."""
        while number > 0:
            number -= 1
            text = self.line(number).strip()
            if text and not text.startswith("#"):
                return number
        return -1

    def below(self, number: int) -> str:
        """The nearest line below that is neither empty nor a comment; empty when there is none."""
        return next((line for line in self.lines[number + 1 :] if line.strip() and line.strip()[0] != "#"), "")

    @functools.cached_property
    def suspect(self) -> int:
        """The line that is not as meant: where a key was expected, or above an unexpected colon; -1 for none."""
        if "simple key" in self.context and self.begin:
            return self.begin[0]
        if VALUES in self.problem and ": " not in self.before:
            return self.above(self.mark[0])
        return -1

    @functools.cached_property
    def tokens(self) -> list[Any]:
        """The tokens up to the mark, as far as there are any."""
        found = []
        try:
            for token in yaml.scan(self.text, Loader=self.loader):
                if (token.start_mark.line, token.start_mark.column) > self.mark:
                    break
                found.append(token)
        except yaml.YAMLError:
            pass
        return found


def indent(line: str) -> int:
    """The number of spaces that a line begins with."""
    return len(line) - len(line.lstrip(" "))


def spaces(number: int) -> str:
    return f"{number} space{'' if number == 1 else 's'}"


def shortened(text: str) -> str:
    """A piece of a line for a message."""
    return text if len(text) <= 60 else text[:57] + "..."
