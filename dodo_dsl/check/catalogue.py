"""The rule catalogue: for each rule a summary, its reason, and an example that violates it.

docs/reference/rules.md (``scripts/make-rules``) and ``dodo explain RULE`` are generated from ``catalogue.yml``.
"""

import functools
import itertools
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.source import plain, read

FILE = Path(__file__).with_name("catalogue.yml")

_INTRODUCTION = """\
# Rules

The rules that `dodo compile` checks, by the name that it prints in square brackets; `dodo explain RULE` shows the same
in a terminal.

Each example has only the keys that differ from a valid test `example.dodo.yml`. A line such as `# dodo.yml` begins
another file.

`scripts/make-rules` generates this page from `dodo_dsl/check/catalogue.yml`.
"""


@dataclass(frozen=True)
class Page:
    name: str
    group: str
    summary: str
    why: str
    bad: str
    encoding: str = "utf-8"


@functools.cache
def pages() -> dict[str, Page]:
    node, problems = read(FILE)
    if node is None or problems:
        raise ValueError(f"{FILE.name}: {problems}")
    return {
        name: _page(name, group, **{key: text.strip("\n") for key, text in page.items()})
        for group, members in plain(node).items()
        for name, page in members.items()
    }


def _page(name: str, group: str, summary: str, why: str = "", bad: str = "", driver: str = "", **more: str) -> Page:
    """``driver`` are keys of the application's service."""
    compose = f"# docker-compose.yml\nservices:\n  driver: {{image: driver, {driver}}}" if driver else ""
    return Page(name, group, summary, why, "\n".join(filter(None, (bad, compose))), **more)


def text(page: Page) -> str:
    parts = [f"{page.name}: {page.summary}", textwrap.fill(page.why, 100)]
    parts += ["This violates the rule:", textwrap.indent(page.bad, "    ")]
    return "\n\n".join(filter(None, parts)) + "\n"


def markdown() -> str:
    return "\n".join((_INTRODUCTION, *_sections()))


def _sections() -> Iterator[str]:
    for group, members in itertools.groupby(pages().values(), lambda page: page.group):
        yield f"\n## {group}"
        for page in members:
            yield "\n".join(["", f"### {page.name}", "", page.summary, *filter(None, [page.why]), ""])
            yield f"```yaml\n{page.bad}\n```"
    yield ""


def write(file: Path) -> None:
    atomic.write_text(file, markdown())
