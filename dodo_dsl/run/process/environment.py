"""Environment variables of a test's processes: those of DoDo's own services, and those that an application gets."""

import os
import sys
from collections.abc import Collection
from pathlib import Path

from dodo_dsl.application import secret_variables

_FOR_APPLICATIONS = ("PATH", "HOME", "USER", "LANG", "TZ", "TERM", "PYTHONUNBUFFERED", "VIRTUAL_ENV",
                     "LD_LIBRARY_PATH", "PYTHONPATH", "CLUON_SHAREDMEMORY_POSIX")  # fmt: skip
"""Also where programs and libraries are, and how libcluon shares memory: set once for DoDo and all that it starts."""


def own_environment(passed: Collection[str] = ()) -> dict[str, str]:
    """DoDo's own environment for its sandboxes and services, without secrets but for those that ``dodo.yml`` passes."""
    return secret_variables.visible(os.environ, passed)


def base_environment(passed: Collection[str] = ()) -> dict[str, str]:
    """The same with the folder of DoDo's interpreter first in ``PATH``, and unbuffered Python."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    return {**own_environment(passed), "PATH": path, "PYTHONUNBUFFERED": "1"}


def application_environment(passed: Collection[str] = ()) -> dict[str, str]:
    """What a process of the application gets of DoDo's own environment: what it needs to run, and what is passed."""
    given, names = base_environment(passed), {*_FOR_APPLICATIONS, *passed}
    return {name: value for name, value in given.items() if name in names or name.startswith("LC_")}
