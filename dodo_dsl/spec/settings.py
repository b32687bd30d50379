"""Settings of the command line, which override the specs before anything is checked or built."""

from dataclasses import dataclass, replace

from dodo_dsl.spec.model import Spec


@dataclass(frozen=True)
class Settings:
    """Inputs of a compilation; None keeps the value of the specs.

    ``wall_timeout_s`` limits the wall time of a test in lockstep, in seconds. ``repeat`` is how often each test runs.
    """

    clock: str | None = None
    isolation: str | None = None
    seed: int | None = None
    wall_timeout_s: float | None = None
    repeat: int = 1


def applied(spec: Spec, settings: Settings) -> Spec:
    """The spec with the settings; a test on hardware keeps its clock."""
    if settings.clock and spec.level != "hil":
        spec = replace(spec, clock=settings.clock)
    if settings.isolation:
        spans = {key: span for key, span in spec.spans.items() if key != "isolation"}
        spec = replace(spec, isolation=settings.isolation, spans=spans)
    return spec if settings.seed is None else replace(spec, seed=settings.seed)
