"""Where a parser gave up, and what that means."""

import functools
from dataclasses import dataclass
from typing import Any

import yaml

from dodo_dsl.diagnostics import Fix

Mark = tuple[int, int]
"""Line and column, from 0."""


@dataclass(frozen=True)
class Slip:
    """A mistake in a text: its place, counted from 0, and words about it; ``is_tab`` for indentation with a tab.

    ``fix`` is for the one character at the place, where there is exactly one fix.
    """

    line: int
    column: int
    message: str
    hint: str = ""
    is_tab: bool = False
    fix: Fix | None = None


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
        return self.text.splitlines()

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


def shortened(text: str) -> str:
    """A piece of a line for a message."""
    return text if len(text) <= 60 else text[:57] + "..."
