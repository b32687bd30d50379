"""Follows a page as a reader does: writes its files, runs its commands, makes its edits, and compares what is said.

A block below a sentence that ends in ``Write `FILE`:`` is a new file. A block ``console`` has commands after ``$`` with
what they print, where ``...`` stands for anything. A block ``diff`` begins with ``--- FILE``; the text of its lines
after ``-`` is replaced by that after ``+``. Other blocks are not run.
"""

import os
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_BLOCK = re.compile(
    r"(?:Write `(?P<file>[^`\n]+)`:\n\n)?^```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE
)


@dataclass(frozen=True)
class Command:
    words: str
    said: str
    """What the page shows of its output."""

    def wrong(self, output: str) -> str:
        """What differs; empty if nothing does."""
        parts = [re.escape(part) for part in self.said.strip("\n").split("...")]
        pattern = re.sub(r"\n$", "\n", ".*?".join(parts))
        return "" if re.fullmatch(pattern, output.strip("\n"), re.DOTALL) else f"$ {self.words}\n{output}"


@dataclass(frozen=True)
class Edit:
    file: str
    old: str
    new: str

    def make(self, folder: Path) -> None:
        path = folder / self.file
        text = path.read_text()
        assert text.count(self.old) == 1, f"{self.file} has {self.old!r} {text.count(self.old)} times"
        path.write_text(text.replace(self.old, self.new))


@dataclass(frozen=True)
class New:
    file: str
    text: str

    def make(self, folder: Path) -> None:
        path = folder / self.file
        assert not path.exists(), f"{self.file} is there already"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(self.text)


def steps(page: str) -> Iterator[Command | Edit | New]:
    for block in _BLOCK.finditer(page):
        kind, text = block["kind"], block["text"]
        if block["file"]:
            yield New(block["file"], text)
        elif kind == "diff":
            first, *lines = text.splitlines()
            old, new = ("\n".join(line[1:] for line in lines if line[0] == sign) for sign in "-+")
            yield Edit(first.removeprefix("--- "), old, new)
        elif kind == "console":
            for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
                words, _, said = part.partition("\n")
                yield Command(words, said)


def follow(page: Path, folder: Path, programs: Path) -> None:
    """Raises AssertionError where the page is not right; ``programs`` is the folder of ``dodo``."""
    environment = {
        **os.environ,
        "PATH": f"{programs}:{os.environ['PATH']}",
        "NO_COLOR": "1",
        "PYTEST_ADDOPTS": "",
        "COLUMNS": "80",
    }
    for step in steps(page.read_text()):
        if isinstance(step, Edit | New):
            step.make(folder)
            continue
        done = subprocess.run(
            ["bash", "-c", step.words], cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True, check=False, timeout=600,
        )  # fmt: skip
        assert not (wrong := step.wrong(done.stdout)), f"{page.name} shows\n{step.said}\nand this comes:\n{wrong}"
