"""A stream that rich takes for a terminal, and what a reader sees of it."""

import io
import re

import pytest

SAID = (
    "device [/dev/ttyACM0] is gone",
    "[red]no colour is meant[/red]",
    "a [/] that closes nothing",
    ":warning: is no picture",
)
"""Texts that look like rich's markup."""


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal that takes every line whole, whatever these tests run in."""
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "xterm")


def shown(text: str) -> str:
    """Without what moves a terminal's cursor or colours it."""
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)
