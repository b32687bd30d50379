"""Keeps compiled templates between runs, in ``dodo`` of the user's cache folder.

That folder is the one of the XDG Base Directory Specification: ``$XDG_CACHE_HOME``, by default ``~/.cache``. To compile
the templates of a run takes a tenth of a second, more than all else that is done with them.
"""

import contextlib
import os
import pwd
from pathlib import Path

import jinja2
from jinja2.bccache import Bucket

from dodo_dsl import __version__
from dodo_dsl.state_folder import secured


class _Cache(jinja2.FileSystemBytecodeCache):
    """Templates are compiled again where they can be neither read nor kept."""

    def load_bytecode(self, bucket: Bucket) -> None:
        with contextlib.suppress(OSError):
            super().load_bytecode(bucket)

    def dump_bytecode(self, bucket: Bucket) -> None:
        with contextlib.suppress(OSError):
            super().dump_bytecode(bucket)


def compiled_templates() -> jinja2.BytecodeCache | None:
    """The cache of this version, which Jinja keys by the template's name and text, and its own version and Python's.

    None for users without a folder for it that only they can write: what is in it is run.
    """
    try:
        folder = secured(secured(cache_home() / "dodo") / f"templates-{__version__}")
        return _Cache(str(folder))
    except (OSError, KeyError):
        return None


def cache_home() -> Path:
    """The folder of a user's caches; a relative path counts as none, as that specification says. Raises KeyError."""
    wanted = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (
        wanted if wanted.is_absolute() else Path(os.environ.get("HOME") or pwd.getpwuid(os.getuid()).pw_dir) / ".cache"
    )
