"""A job of the child pipeline."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

SPARE_MINUTES = 10
"""Beyond what its tests may take."""


@dataclass(frozen=True)
class PipelineJob:
    """``rig`` is the resource that it locks, ``image`` that of its container, both may be empty.

    ``pool`` has the names of the rigs of which it takes any; GitLab cannot lock one of several.

    It runs the compiled ``tests``, slugs, in ``folders`` as the parent's artifact has them.
    """

    name: str
    stage: str
    tags: tuple[str, ...]
    gated: bool
    rig: str
    minutes: int
    interruptible: bool
    tests: tuple[str, ...]
    folders: tuple[str, ...] = ()
    image: str = ""
    pool: tuple[str, ...] = ()
    backend: str = ""
    """What the tests run on unless the options of a pipeline name another; empty for dodo's own choice."""
    services: tuple[str | Mapping[str, Any], ...] = ()
    before_script: str = ""

    @property
    def script(self) -> str:
        compiled = " ".join(f"--compiled {shlex.quote(folder)}" for folder in self.folders)
        backend = f" --backend {self.backend}" if self.backend else ""
        alone = (self.rig or self.pool) and len(self.tests) > 1  # else they would wait for each other's lease
        jobs = " --jobs 1" if alone else ""
        return f"dodo run {compiled}{backend} --report dodo-report $DODO_RUN_OPTIONS{jobs}"
