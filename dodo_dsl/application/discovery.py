"""What ``docker compose`` reads without being told: files that it finds beside those that DoDo was given."""

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from dodo_dsl.application.compose_files import variables_of
from dodo_dsl.diagnostics import Diagnostic, Span, listed

_NAMES = ("compose.yaml", "compose.yml", "docker-compose.yml", "docker-compose.yaml")
_OVERRIDES = (
    "compose.override.yml",
    "compose.override.yaml",
    "docker-compose.override.yml",
    "docker-compose.override.yaml",
)
"""Of each, compose takes the first that is there."""
_LIST, _SEPARATOR = "COMPOSE_FILE", "COMPOSE_PATH_SEPARATOR"
_PLAIN = re.compile(r"[\w./-]+")


def unread(paths: Sequence[Path], root: Path | None = None) -> Iterator[Diagnostic]:
    """A warning where compose would read other files together with one of ``paths``.

    Its hint names files as ``dodo.yml`` does, which is in ``root`` or else beside them.
    """
    folder = paths[0].parent
    named = [_whole(path) for path in paths]
    found, why = _discovered(folder)
    others = [path for path in found if path not in named]
    if not others or len(others) == len(found):
        return
    names = listed([f"'{os.path.relpath(path, folder)}'" for path in others])
    items = [_item(path, root or folder) for path in [*found, *(path for path in named if path not in found)]]
    own = _item(next(path for path in named if path in found), folder)
    yield Diagnostic(
        Span(str(paths[0])),
        "application-override",
        f"'docker compose' also reads {names}, {why}; DoDo does not",
        f"write application: [{', '.join(items)}] in dodo.yml; to test without it, name another file there that has "
        f"include: [{own}]",
        "warning",
    )


def _discovered(folder: Path) -> tuple[list[Path], str]:
    """The files that compose reads in a folder, in its order, and why it reads the later ones."""
    variables = variables_of(folder / ".env")
    if text := variables.get(_LIST):
        names = text.split(variables.get(_SEPARATOR) or os.pathsep)
        return [_whole(folder / name) for name in names if name], f"as {_LIST} in .env says"
    there = [[_whole(folder / name) for name in names if (folder / name).is_file()] for names in (_NAMES, _OVERRIDES)]
    return [paths[0] for paths in there if paths], "which it finds beside this file"


def _whole(path: Path) -> Path:
    return Path(os.path.normpath(path.absolute()))


def _item(path: Path, folder: Path) -> str:
    """A path as an item of a list in YAML."""
    text = os.path.relpath(path, _whole(folder))
    return text if _PLAIN.fullmatch(text) else f'"{text}"'
