"""What a new test of a level and a kind begins with: a template, or a copy of a test that ships with DoDo."""

from collections.abc import Sequence
from dataclasses import dataclass

from dodo_dsl import package_data
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.spec.model import LEVELS, Spec
from dodo_dsl.spec.registry import SUFFIX

LEVEL, KIND = "sil", "closed-loop"
"""Of a test for which none is named."""
_SHIPPED = {
    ("sil", "perception"): ("sil-perception", "needs the true boxes of its pictures"),
    ("dil", "open-loop"): ("dil-kiwi-track", "needs a recording"),
    ("dil", "perception"): ("dil-static-rig", "needs a recording"),
    ("hil", "open-loop"): ("hil-open-straight", "needs a path of its rig"),
    ("hil", "perception"): ("hil-camera", "needs the true boxes of its pictures"),
}
"""Shipped tests to copy for kinds that need more than a spec, and why."""


@dataclass(frozen=True)
class Start:
    """``template`` is empty where ``shipped`` is copied, for the reason ``why``."""

    level: str
    kind: str
    template: str = ""
    shipped: str = ""
    why: str = ""


def start(level: str, kind: str, name: str = "NAME") -> Start:
    """Raises UsageError where no test, of a ``name``, can have the level and the kind."""
    if (level, kind) == ("dil", "closed-loop"):
        reason = "a dil test cannot be closed-loop: what was recorded does not react to the application"
        raise UsageError(f"{reason}; try: dodo new {name} --level dil --kind open-loop")
    shipped, why = _SHIPPED.get((level, kind), ("", ""))
    if shipped:
        return Start(level, kind, shipped=shipped, why=why)
    return Start(level, kind, f"tests/{level}-{kind}{SUFFIX}")


def kinds(level: str) -> list[str]:
    """The kinds of a level, the usual one first."""
    templates = (package_data.templates() / "new/tests").glob(f"{level}-*{SUFFIX}")
    own = [path.name.removesuffix(SUFFIX).removeprefix(f"{level}-") for path in sorted(templates)]
    return [*own, *(kind for other, kind in _SHIPPED if other == level)]


def listing(shipped: Sequence[Spec]) -> str:
    """Everything that a new test may begin with, as text."""
    rows = []
    for found in (start(level, kind) for level in LEVELS for kind in kinds(level)):
        words = f"--level {found.level} --kind {found.kind}"
        default = " (what NAME alone writes)" if (found.level, found.kind) == (LEVEL, KIND) else ""
        rows.append((words, (f"a copy of {found.shipped}" if found.shipped else "a first test") + default))
    copies = [(f"--extends {spec.name}", spec.description or "") for spec in once(shipped)]
    return (
        "dodo new NAME writes a test, which begins as\n"
        + _table(rows)
        + "\nor, with --level dil --rec FILE.rec, as a test of a recording of your own\n"
        + "\nor as a copy of a test that ships with DoDo\n"
        + _table(copies)
        + "\ndodo new --application writes an application and a test that it passes, dodo new --deployment what a\n"
        + "repository needs beside its application and its tests; dodo new --help says more\n"
    )


def once(specs: Sequence[Spec]) -> list[Spec]:
    """The first instance of each test."""
    return list({spec.path: spec for spec in reversed(specs)}.values())[::-1]


def _table(rows: Sequence[tuple[str, str]]) -> str:
    width = max((len(words) for words, _ in rows), default=0)
    return "".join(f"  {words.ljust(width)}  {text}\n" for words, text in rows)
