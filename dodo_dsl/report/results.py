"""``results.json``: the outcomes of a run, when, where and of what it was, and how to repeat it.

``scripts/make-schema`` makes ``schemas/results.schema.json`` of the classes. A report that a command line names, by its
folder or its ``results.json``, is untrusted.
"""

import dataclasses
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec

from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import NotRun, Outcome
from dodo_dsl.spec.matrix import SLUG
from dodo_dsl.spec.model import is_goal

COMMIT = re.compile(r"[0-9a-f]{40}|[0-9a-f]{64}")
_DATE = r"^\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}\+00:00$"
_SHOWN = 12


@dataclass(frozen=True)
class Repository:
    """A git repository at a commit."""

    what: str
    """What is in it: the application, the tests, or both."""
    commit: Annotated[str, msgspec.Meta(pattern=f"^({COMMIT.pattern})$")]
    """Commit that was checked out."""
    changed: bool
    """Whether it had changes or files that were in no commit."""

    def in_words(self) -> str:
        return f"{self.what} at commit {self.commit[:_SHOWN]}" + (" with uncommitted changes" if self.changed else "")


@dataclass(frozen=True)
class RunRecord:
    """When, where and of what a run was, and how to repeat it."""

    date: Annotated[str, msgspec.Meta(pattern=_DATE)]
    """When it began, in UTC (ISO 8601)."""
    host: str
    """Name of the machine."""
    dodo: str
    """Version of DoDo."""
    command: str
    """What repeats it, without options that may carry secrets."""
    repositories: tuple[Repository, ...] = ()
    """The git repositories of application and tests."""

    def in_words(self) -> str:
        """All but the command."""
        date = self.date[:16].replace("T", " ")
        return ", ".join(
            [f"{date} UTC on {self.host} with DoDo {self.dodo}", *(r.in_words() for r in self.repositories)]
        )


FILE_NAME = "results.json"
MOST_SLUG = 240
"""Characters of a slug, which names a folder."""
_SHOWN_PATH = 60


class ResultsError(ValueError):
    """A file without results of this version."""

    usage = True


@dataclass(frozen=True)
class Circumstances:
    """What results say besides the outcomes."""

    runs: tuple[RunRecord, ...] = ()
    """The runs that the outcomes are of: one, or several in a joined report."""
    not_run: tuple[NotRun, ...] = ()
    """Tests of the run that never began, because it was interrupted or a test before them did not pass (--fail-fast);
    they have no outcome."""


@dataclass(frozen=True, kw_only=True)
class Results(Circumstances):
    """Outcomes of a run, as written to results.json."""

    dodo: Literal["results"]
    """Type of the file."""
    version: Literal[1]
    """Version of the format."""
    tests: tuple[Outcome, ...]
    """One outcome per executed instance."""


NO_CIRCUMSTANCES = Circumstances()


@dataclass(frozen=True)
class GivenReport:
    """The outcomes that a file holds; the files of its tests lie beside it where it is a report's."""

    file: Path
    outcomes: Sequence[Outcome]
    circumstances: Circumstances = NO_CIRCUMSTANCES

    @property
    def is_whole(self) -> bool:
        """Whether it may have files of its tests beside it, and not its outcomes alone."""
        return self.file.name == FILE_NAME

    @property
    def folder(self) -> Path:
        return self.file.parent


def to_json(outcomes: Sequence[Outcome], circumstances: Circumstances = NO_CIRCUMSTANCES) -> str:
    """What ``load`` reads; a question mark stands for each character that UTF-8 cannot encode."""
    besides = {key: value for key, value in dataclasses.asdict(circumstances).items() if value}
    tests = [_rounded(dataclasses.asdict(outcome)) for outcome in outcomes]
    document = {"dodo": "results", "version": 1, **besides, "tests": tests}
    return json.dumps(document, indent=2, ensure_ascii=False).encode(errors="replace").decode() + "\n"


class JoinedTest(NamedTuple):
    """A test with a slug and name that no other has, and where it comes from: a report, and its slug there."""

    outcome: Outcome
    report: GivenReport
    slug: str


def distinct(reports: Sequence[GivenReport]) -> Iterator[JoinedTest]:
    """All tests in the order of the reports.

    The first of a slug keeps it and its name; further ones are called ``<slug>--report-2`` and ``<name>[report=2]``,
    with the next number that is free.
    """
    given = [(outcome, report) for report in reports for outcome in report.outcomes]
    taken, used = {outcome.slug for outcome, _ in given}, set[str]()
    for outcome, report in given:
        named, n = outcome, 2
        while named.slug in used or (n > 2 and named.slug in taken):
            named = replace(outcome, slug=f"{outcome.slug}--report-{n}", name=f"{outcome.name}[report={n}]")
            n += 1
        used.add(named.slug)
        yield JoinedTest(named, report, outcome.slug)


def _rounded(value: Any, name: str = "") -> Any:
    """Rounds durations and shares to 0.001, which is more than the precision of the measurement."""
    if isinstance(value, dict):
        return {key: _rounded(each, key) for key, each in value.items()}
    if name == "resources":
        return [_rounded(use) for use in value]
    return round(value, 3) if name.endswith(("_s", "_share")) and value is not None else value


def joined(each: Sequence[GivenReport]) -> Circumstances:
    """Those of several results together; a test that ran in one of them was not left out."""
    ran = {outcome.slug for one in each for outcome in one.outcomes}
    left = {test.slug: test for one in each for test in one.circumstances.not_run if test.slug not in ran}
    runs = dict.fromkeys(run for one in each for run in one.circumstances.runs)
    return Circumstances(tuple(runs), tuple(left.values()))


def load(path: Path) -> list[Outcome]:
    """The outcomes of the report in a folder, or of a file; raises ResultsError."""
    return list(read_given(path).outcomes)


def read_given(path: Path) -> GivenReport:
    """The report in a folder, or of a file; raises ResultsError, also if a slug could leave its folder."""
    is_file = not path.is_dir() and (path.is_file() or path.suffix == ".json")
    file = path if is_file else path / FILE_NAME
    try:
        found = msgspec.json.decode(regular_file.content(file), type=Results)
    except FileNotFoundError as error:
        raise ResultsError(f"there is no {file}") from error
    except OSError as error:
        raise ResultsError(f"{file} cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise ResultsError(f"{file}: not results of DoDo ({error})") from error
    if not all(is_goal(goal) for outcome in found.tests for goal in outcome.goals):
        raise ResultsError(f"{file}: a goal whose numbers make no score")
    for outcome in found.tests:
        if len(outcome.slug) > MOST_SLUG or not SLUG.fullmatch(outcome.slug):
            shown = outcome.slug[:_SHOWN_PATH]
            raise ResultsError(f"{file}: '{shown}' is not a slug, expected lower-case letters, digits and hyphens")
    return GivenReport(file, found.tests, Circumstances(found.runs, found.not_run))
