"""A file that ``dodo new`` writes, and the templates that fill it."""

import functools
from dataclasses import dataclass
from pathlib import Path

import jinja2

from dodo_dsl import package_data


@dataclass(frozen=True)
class New:
    """A file to write: its path and its content."""

    path: Path
    content: bytes


@functools.cache
def _templates() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(package_data.templates() / "new"),
        undefined=jinja2.StrictUndefined,
        autoescape=False,  # noqa: S701  (YAML and Markdown of names that are checked)
        keep_trailing_newline=True,
        trim_blocks=True,
    )


def filled(template: str, **values: object) -> bytes:
    return _templates().get_template(template).render(**values).encode()
