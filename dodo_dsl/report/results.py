"""``results.json``: the outcomes of a run, when, where and of what it was, and how to repeat it.

``schemas/results.schema.json`` describes it. A report that a command line names, by its folder or its
``results.json``, is untrusted.
"""

import dataclasses
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dodo_dsl import package_data
from dodo_dsl.diagnostics import did_you_mean
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import NotRun, Outcome
from dodo_dsl.report.repetitions import Repeated
from dodo_dsl.spec.matrix import SLUG
from dodo_dsl.spec.model import is_goal

COMMIT = re.compile(r"[0-9a-f]{40}|[0-9a-f]{64}")
_SHOWN = 12


@dataclass(frozen=True)
class Repository:
    """A git repository at a commit; ``what`` is in it, the application or the tests.

    ``changed`` means that it had changes or files that were in no commit.
    """

    what: str
    commit: str
    changed: bool

    def in_words(self) -> str:
        return f"{self.what} at commit {self.commit[:_SHOWN]}" + (" with uncommitted changes" if self.changed else "")


@dataclass(frozen=True)
class RunRecord:
    """``date`` is ISO 8601 in UTC, ``dodo`` the version, ``command`` without what may be secret."""

    date: str
    host: str
    dodo: str
    command: str
    repositories: tuple[Repository, ...] = ()

    def in_words(self) -> str:
        """All but the command."""
        date = self.date[:16].replace("T", " ")
        return ", ".join(
            [f"{date} UTC on {self.host} with DoDo {self.dodo}", *(r.in_words() for r in self.repositories)]
        )


FILE_NAME = "results.json"
VERSION = 1
_MAX_PROBLEM_TEXT = 200
_MOST_DIGITS = 300


class ResultsError(ValueError):
    """A file without results of this version."""


@dataclasses.dataclass(frozen=True)
class Circumstances:
    """What results say besides the outcomes: of which runs they are, the tests that never began, and repetitions."""

    runs: tuple[RunRecord, ...] = ()
    not_run: tuple[NotRun, ...] = ()
    repeated: tuple[Repeated, ...] = ()


NO_CIRCUMSTANCES = Circumstances()


@dataclasses.dataclass(frozen=True)
class Results:
    """All that a ``results.json`` holds."""

    outcomes: Sequence[Outcome]
    circumstances: Circumstances


def to_json(outcomes: Sequence[Outcome], circumstances: Circumstances = NO_CIRCUMSTANCES) -> str:
    tests = [_rounded(dataclasses.asdict(outcome)) for outcome in outcomes]
    head = {"dodo": "results", "version": VERSION}
    besides = {key: value for key, value in dataclasses.asdict(circumstances).items() if value}
    return json.dumps({**head, **besides, "tests": tests}, indent=2, ensure_ascii=False) + "\n"


def writable(outcome: Outcome) -> Outcome:
    """The same with a question mark for each character that UTF-8 cannot encode, as in the names of some files."""
    return dataclasses.replace(
        outcome,
        name=_written(outcome.name),
        spec=_written(outcome.spec),
        description=_written(outcome.description),
        reason=_written(outcome.reason),
        last_lines=tuple(map(_written, outcome.last_lines)),
        notes=tuple(map(_written, outcome.notes)),
    )


def writable_circumstances(circumstances: Circumstances) -> Circumstances:
    """The same without characters that UTF-8 cannot encode."""
    not_run = (
        dataclasses.replace(test, name=_written(test.name), spec=_written(test.spec)) for test in circumstances.not_run
    )
    runs = (
        dataclasses.replace(run, host=_written(run.host), command=_written(run.command)) for run in circumstances.runs
    )
    return Circumstances(tuple(runs), tuple(not_run), tuple(map(_writable_repeated, circumstances.repeated)))


def _writable_repeated(repeated: Repeated) -> Repeated:
    differing = (dataclasses.replace(d, values=tuple(map(_written, d.values))) for d in repeated.differing)
    return dataclasses.replace(repeated, differing=tuple(differing))


def joined(each: Sequence[Results]) -> Circumstances:
    """Those of several results together; a test that ran in one of them was not left out."""
    ran = {outcome.slug for one in each for outcome in one.outcomes}
    left = {test.slug: test for one in each for test in one.circumstances.not_run if test.slug not in ran}
    runs = dict.fromkeys(run for one in each for run in one.circumstances.runs)
    return Circumstances(
        tuple(runs), tuple(left.values()), tuple(known for one in each for known in one.circumstances.repeated)
    )


def _written(text: str) -> str:
    return text.encode(errors="replace").decode()


def _rounded(test: dict[str, Any]) -> dict[str, Any]:
    """Rounds durations and shares to 0.001, which is more than the precision of the measurement."""
    return {name: _rounded_value(name, value) for name, value in test.items()}


def _rounded_value(name: str, value: Any) -> Any:
    if isinstance(value, dict):
        return _rounded(value)
    if name == "resources":
        return [_rounded(use) for use in value]
    return round(value, 3) if name.endswith(("_s", "_share")) and value is not None else value


def load(path: Path) -> list[Outcome]:
    """The outcomes of a ``results.json`` that its schema accepts; raises ResultsError."""
    return list(read_results(path).outcomes)


def read_results(path: Path) -> Results:
    """A ``results.json`` that its schema accepts; raises ResultsError."""
    import msgspec

    try:
        document = json.loads(regular_file.text(path), parse_int=_whole)
        if document["dodo"] != "results" or document["version"] != VERSION:
            raise ResultsError(f"{path}: not results of version {VERSION}")
        _validate(document)
        outcomes = msgspec.convert(document["tests"], tuple[Outcome, ...])
        if not all(is_goal(goal) for outcome in outcomes for goal in outcome.goals):
            raise ResultsError(f"{path}: a goal whose numbers make no score")
        return Results(outcomes, msgspec.convert(document, Circumstances))
    except FileNotFoundError as error:
        raise ResultsError(f"there is no {path}") from error
    except OSError as error:
        raise ResultsError(f"{path} cannot be read: {error.strerror}") from error
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError, msgspec.ValidationError) as error:
        raise ResultsError(f"{path}: not results of DoDo ({error})") from error


def _whole(digits: str) -> int | float:
    """A number as others read it, too: what no float holds is infinite."""
    return int(digits) if len(digits) < _MOST_DIGITS else float(digits)


def _validate(document: Any) -> None:
    """Raises ValueError with the place of the most relevant problem, or for strings that UTF-8 cannot encode."""
    from jsonschema import Draft202012Validator
    from jsonschema.exceptions import best_match

    schema = json.loads((package_data.schemas() / "results.schema.json").read_text(encoding="utf-8"))
    problem = best_match(Draft202012Validator(schema).iter_errors(document))
    if problem is not None:
        raise ValueError(_sentence(problem))
    json.dumps(document, ensure_ascii=False).encode()


def _sentence(problem: Any) -> str:
    """What is wrong, with its place, and the key that a key of no meaning may be."""
    if problem.validator != "additionalProperties":
        return f"{problem.json_path}: {problem.message[:_MAX_PROBLEM_TEXT]}"
    known = problem.schema["properties"]
    name = next(key for key in problem.instance if key not in known)
    hint = did_you_mean(name, known.keys() - problem.instance.keys())
    told = f"; {hint}" if hint.startswith("did") else ""
    return f"{problem.json_path}: unknown key '{name[:_MAX_PROBLEM_TEXT]}'{told}"


MOST_SLUG = 240
"""Characters of a slug, which names a folder."""
_SHOWN_PATH = 60


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


def read_given(path: Path) -> GivenReport:
    """The report in a folder, or of a file; raises ResultsError, also if a slug could leave its folder."""
    is_file = not path.is_dir() and (path.is_file() or path.suffix == ".json")
    file = path if is_file else path / FILE_NAME
    found = read_results(file)
    for outcome in found.outcomes:
        if len(outcome.slug) > MOST_SLUG or not SLUG.fullmatch(outcome.slug):
            shown = outcome.slug[:_SHOWN_PATH]
            raise ResultsError(f"{file}: '{shown}' is not a slug, expected lower-case letters, digits and hyphens")
    return GivenReport(file, found.outcomes, found.circumstances)
