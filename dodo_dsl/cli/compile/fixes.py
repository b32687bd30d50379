"""``dodo compile --check --fix``: writes what has exactly one fix into the files, and shows it as a diff."""

import difflib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

from dodo_dsl import atomic, package_data
from dodo_dsl.diagnostics import Diagnostic, Fix, Span, shown_path
from dodo_dsl.terminal import printable

Fixes = dict[Span, Fix]


def apply(diagnostics: Iterable[Diagnostic], root: Path) -> str:
    """Mends the files of the repository at ``root`` and returns the diff; each file appears whole. Raises OSError."""
    by_file: dict[Path, Fixes] = defaultdict(dict)
    for diagnostic in diagnostics:
        path = Path(diagnostic.span.file)
        if diagnostic.fix and path.is_file() and _is_own(path, root):
            by_file[path.resolve()][diagnostic.span] = diagnostic.fix
    return "".join(_mended(path, fixes) for path, fixes in sorted(by_file.items()))


def _is_own(path: Path, root: Path) -> bool:
    return path.resolve().is_relative_to(root.resolve()) and not package_data.is_shipped(path, root)


def _mended(path: Path, fixes: Fixes) -> str:
    """Writes one file and returns its diff; line ends, comments and layout stay."""
    before = path.read_bytes().decode().splitlines(keepends=True)
    after = list(before)
    for span, fix in sorted(fixes.items(), reverse=True):
        if span.line <= len(after):
            after[span.line - 1] = _line(after[span.line - 1], span, fix)
    if after == before:
        return ""
    atomic.write_bytes(path, "".join(after).encode())
    name = shown_path(str(path))
    return "".join(_shown(difflib.unified_diff(before, after, name, name, n=1)))


def _line(line: str, span: Span, fix: Fix) -> str:
    start, end = span.column - 1, span.column - 1 + span.length
    return line[:start] + fix.mended(line[start:end]) + line[end:]


def _shown(lines: Iterable[str]) -> Iterator[str]:
    return (printable(line.rstrip("\r\n")) + "\n" for line in lines)
