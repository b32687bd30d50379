"""A report that a command line names: its folder, or its ``results.json``. It may come from a stranger."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.outcome import Outcome
from dodo_dsl.report import results
from dodo_dsl.spec.instances.matrix import SLUG

MOST_SLUG = 240
"""Characters of a slug, which names a folder."""
_SHOWN = 60


@dataclass(frozen=True)
class GivenReport:
    """The outcomes that a file holds; the files of its tests lie beside it where it is a report's."""

    file: Path
    outcomes: Sequence[Outcome]
    circumstances: results.Circumstances = results.NO_CIRCUMSTANCES

    @property
    def is_whole(self) -> bool:
        """Whether it may have files of its tests beside it, and not its outcomes alone."""
        return self.file.name == results.FILE_NAME

    @property
    def folder(self) -> Path:
        return self.file.parent


def read(path: Path) -> GivenReport:
    """The report in a folder, or of a file; raises ResultsError, also where a slug could leave its folder."""
    is_file = not path.is_dir() and (path.is_file() or path.suffix == ".json")
    file = path if is_file else path / results.FILE_NAME
    found = results.read(file)
    for outcome in found.outcomes:
        if len(outcome.slug) > MOST_SLUG or not SLUG.fullmatch(outcome.slug):
            shown = outcome.slug[:_SHOWN]
            raise results.ResultsError(f"{file}: '{shown}' is no slug, expected lower-case letters, digits and hyphens")
    return GivenReport(file, found.outcomes, found.circumstances)
