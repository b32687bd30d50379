"""Files as they are written, and what comes next, as ``dodo new`` says it."""

from collections.abc import Sequence
from typing import TextIO

from dodo_dsl.cli.new.new_file import New
from dodo_dsl.diagnostics import shown_path


def write(files: Sequence[New], stdout: TextIO) -> None:
    """Writes new files, none of which may be there."""
    for file in files:
        file.path.parent.mkdir(parents=True, exist_ok=True)
        with file.path.open("xb") as stream:
            stream.write(file.content)
        stdout.write(f"wrote {shown_path(str(file.path))}\n")


def say_next(steps: Sequence[str], stdout: TextIO) -> None:
    """What the user may do now, one step a line."""
    stdout.write("\nnext: " + "\n      ".join(steps) + "\n")
