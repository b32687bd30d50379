"""What the jobs of a child pipeline have in common, as the parent pipeline wants it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dodo_dsl.plan.model import Plan

DEFAULT_TAGS = ("sil",)

Seconds = Callable[[Sequence[Plan]], Mapping[str, float]]
"""How long tests take, by slug, of those of which it is known."""


def _unknown(_plans: Sequence[Plan]) -> Mapping[str, float]:
    return {}


@dataclass(frozen=True)
class JobOptions:
    """``tags`` of the runners of all jobs that occupy no rig, and their ``image``; empty for the runner's own.

    ``services`` are theirs, too, and ``before_script`` are their first commands; ``artifacts_access`` says who may
    download what any job keeps, empty for all. Values are those of GitLab's keywords.

    ``run_options`` are those of ``dodo run`` in each test, which a variable ``DODO_RUN_OPTIONS`` replaces. ``images``
    are those of the application that the parent has built, as lines ``DODO_IMAGE_<SERVICE>=<image>``. Where
    ``most_jobs`` is not 0, tests share so many jobs, evenly by ``seconds``. Jobs have large files ``from_repository``,
    as they check it out, or else from the artifact of the parent, which may have ``artifact_mb`` MB; 0 for any number.
    """

    tags: tuple[str, ...] = DEFAULT_TAGS
    image: str = ""
    run_options: str = ""
    images: tuple[str, ...] = ()
    most_jobs: int = 0
    seconds: Seconds = _unknown
    services: tuple[str | Mapping[str, Any], ...] = ()
    before_script: str = ""
    artifacts_access: str = ""
    from_repository: bool = False
    artifact_mb: int = 0

    @property
    def backend(self) -> str:
        """Images that were built are what is tested, even where the application could run as processes."""
        return "docker" if self.images else ""


NO_OPTIONS = JobOptions()
