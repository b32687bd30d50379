"""Jinja environments of the package's templates."""

import contextlib
import functools
from typing import Any

import jinja2
from jinja2.bccache import Bucket

from dodo_dsl import package_data
from dodo_dsl.state_folder import cache_home, secured


class _Cache(jinja2.FileSystemBytecodeCache):
    """Compiled templates of this user; where they cannot be kept, they are compiled again."""

    def dump_bytecode(self, bucket: Bucket) -> None:
        with contextlib.suppress(OSError):
            super().dump_bytecode(bucket)


@functools.cache
def environment(folder: str = "", **options: Any) -> jinja2.Environment:
    """The environment of a folder of templates, which another one with other ``options`` must not read."""
    cache = None
    with contextlib.suppress(OSError, KeyError):
        cache = _Cache(str(secured(secured(cache_home() / "dodo") / "templates")))
    loader = jinja2.FileSystemLoader(package_data.templates() / folder)
    return jinja2.Environment(  # noqa: S701  (YAML and Markdown; pages say that they escape)
        loader=loader, undefined=jinja2.StrictUndefined, bytecode_cache=cache, **options
    )
