"""Which tests a command line means: names, patterns, files or folders, and levels."""

import argparse
import fnmatch
from collections.abc import Sequence
from pathlib import Path

from dodo_dsl.compiler import Checked, load
from dodo_dsl.diagnostics import did_you_mean
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.registry import SUFFIX


class NoSuchTest(Exception):
    """A name, pattern or path that means no test."""


def add_application(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--application",
        metavar="FILE",
        type=Path,
        help="the application's compose file (default: dodo.yml's)",
    )


def existing_file(path: Path | None) -> Path | None:
    """The path, or NoSuchTest with a sentence when there is no such file."""
    if path is not None and not path.is_file():
        raise NoSuchTest(f"there is no file '{path}', expected the application's compose file")
    return path


def _is_path(word: str) -> bool:
    return "/" in word or word.endswith(SUFFIX) or Path(word).is_dir()


def select(words: Sequence[str], levels: Sequence[str], application: Path | None) -> Checked:
    """The checked specs that the words mean (all without any), kept to the levels; raises NoSuchTest."""
    paths = [Path(word) for word in words if _is_path(word)]
    names = [word for word in words if not _is_path(word)]
    checked = load(paths, existing_file(application))
    if checked.empty:
        raise NoSuchTest(f"there is no test at '{checked.empty[0]}'; specs end in .dodo.yml")
    if names:
        given = {spec.path for spec in checked.specs} if paths else set()
        if paths:
            checked = load([*paths, *checked.deployment.registry], application)
        others = [spec for spec in checked.specs if spec.path not in given]
        chosen = {spec.path for word in names for spec in _named(word, others)}
        checked = _narrowed(checked, [spec for spec in checked.specs if spec.path in given | chosen])
    if levels:
        kept = tuple(s for s in checked.specs if s.level in levels)
        if not kept:
            raise NoSuchTest(f"none of the tests is of level {' or '.join(levels)}")
        checked = _narrowed(checked, kept)
    return checked


def _named(word: str, specs: Sequence[Spec]) -> list[Spec]:
    found = [s for s in specs if fnmatch.fnmatchcase(s.location.stem, word)]
    if not found:
        hint = did_you_mean(word, [s.location.stem for s in specs])
        raise NoSuchTest(f"there is no test '{word}'" + (f"; {hint}" if hint else ""))
    return found


def _narrowed(checked: Checked, specs: Sequence[Spec]) -> Checked:
    """The same with fewer specs; problems of other specs no longer count, those of other files do."""
    kept = {str(s.path): s for s in specs}
    dropped = {str(s.path) for s in checked.specs} - set(kept)
    diagnostics = tuple(d for d in checked.diagnostics if d.span.file not in dropped)
    return Checked(
        checked.deployment,
        checked.manifests,
        tuple(kept.values()),
        diagnostics,
        checked.application,
        checked.empty,
    )
