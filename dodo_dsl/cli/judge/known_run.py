"""What the report around a recording says of the run in which it was made."""

from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.outcome import Outcome
from dodo_dsl.report import results


@dataclass(frozen=True)
class KnownRun:
    """The run of a recording in a report's folder."""

    outcome: Outcome

    @property
    def slug(self) -> str:
        return self.outcome.slug

    @property
    def cid(self) -> int:
        return self.outcome.cid


def known_run(recording: Path) -> KnownRun | None:
    """The run whose report holds a recording, from ``results.json`` above its folder; None where there is none."""
    folder = recording.resolve().parent
    try:
        outcomes = results.load(folder.parent / results.FILE_NAME)
    except results.ResultsError:
        return None
    return next((KnownRun(outcome) for outcome in outcomes if outcome.slug == folder.name), None)
