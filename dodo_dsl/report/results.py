"""``results.json``: the outcomes of a run, when, where and of what it was, and how to repeat it.

``schemas/results.schema.json`` describes it. A report that a command line names, by its folder or its
``results.json``, is untrusted.
"""

import dataclasses
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from types import GenericAlias
from typing import Annotated, Any, Literal, Union

import msgspec

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
_MOST_PROBLEMS, _MOST_COUNTED = 3, 1000
_MOST_DIGITS = 300


class ResultsError(ValueError):
    """A file without results of this version."""


@dataclass(frozen=True)
class Circumstances:
    """What results say besides the outcomes: of which runs they are, the tests that never began, and repetitions."""

    runs: tuple[RunRecord, ...] = ()
    not_run: tuple[NotRun, ...] = ()
    repeated: tuple[Repeated, ...] = ()


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
    tests = [_rounded(test) for test in msgspec.to_builtins(outcomes)]
    head = {"dodo": "results", "version": VERSION}
    besides = {key: value for key, value in msgspec.to_builtins(circumstances).items() if value}
    return json.dumps({**head, **besides, "tests": tests}, indent=2, ensure_ascii=False) + "\n"


def writable(value: Any) -> Any:
    """The same with a question mark for each character that UTF-8 cannot encode, as in the names of some files."""
    if isinstance(value, str):
        return value.encode(errors="replace").decode()
    if isinstance(value, dict):
        return {writable(key): writable(each) for key, each in value.items()}
    if isinstance(value, tuple):
        return tuple(map(writable, value))
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return value
    return dataclasses.replace(value, **{p.name: writable(getattr(value, p.name)) for p in dataclasses.fields(value)})


def joined(each: Sequence[GivenReport]) -> Circumstances:
    """Those of several results together; a test that ran in one of them was not left out."""
    ran = {outcome.slug for one in each for outcome in one.outcomes}
    left = {test.slug: test for one in each for test in one.circumstances.not_run if test.slug not in ran}
    runs = dict.fromkeys(run for one in each for run in one.circumstances.runs)
    return Circumstances(
        tuple(runs), tuple(left.values()), tuple(known for one in each for known in one.circumstances.repeated)
    )


def _rounded(value: Any, name: str = "") -> Any:
    """Rounds durations and shares to 0.001, which is more than the precision of the measurement."""
    if isinstance(value, dict):
        return {key: _rounded(each, key) for key, each in value.items()}
    if name == "resources":
        return [_rounded(use) for use in value]
    return round(value, 3) if name.endswith(("_s", "_share")) and value is not None else value


def load(path: Path) -> list[Outcome]:
    """The outcomes of a ``results.json`` that its schema accepts; raises ResultsError."""
    return list(read_results(path).outcomes)


def read_results(path: Path) -> GivenReport:
    """A ``results.json`` that its schema accepts; raises ResultsError."""
    try:
        document = json.loads(regular_file.text(path), parse_int=_whole)
        if document["dodo"] != "results" or document["version"] != VERSION:
            raise ResultsError(f"{path}: not results of version {VERSION}")
        _validate(document)
        outcomes = msgspec.convert(document["tests"], tuple[Outcome, ...])
        if not all(is_goal(goal) for outcome in outcomes for goal in outcome.goals):
            raise ResultsError(f"{path}: a goal whose numbers make no score")
        return GivenReport(path, outcomes, msgspec.convert(document, Circumstances))
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
    """Raises ValueError with the places of the first problems, or for strings that UTF-8 cannot encode."""
    schema = json.loads((package_data.schemas() / "results.schema.json").read_text(encoding="utf-8"))
    try:
        msgspec.convert(document, _checked(schema, schema["$defs"]))
    except msgspec.ValidationError:
        if problems := _problems(document, schema):
            raise ValueError(problems) from None
    json.dumps(document, ensure_ascii=False).encode()


_BOUNDS = {
    "number": {"minimum": "ge", "maximum": "le", "exclusiveMinimum": "gt"},
    "string": {"pattern": "pattern", "maxLength": "max_length"},
    "object": {"maxProperties": "max_length"},
}
_PLAIN = {"number": float, "integer": int, "string": str, "boolean": bool, "null": None}


def _checked(schema: Mapping[str, Any], defs: Mapping[str, Any]) -> Any:
    """What msgspec takes only if the schema does, for files with thousands of tests: jsonschema takes their time."""
    if "$ref" in schema:
        return _checked(defs[schema["$ref"].removeprefix("#/$defs/")], defs)
    if "type" not in schema:
        return Literal[tuple(schema.get("enum") or [schema["const"]])]
    kind = schema["type"]
    if isinstance(kind, list):
        return Union[tuple(_checked({**schema, "type": each}, defs) for each in kind)]  # noqa: UP007  (computed)
    if kind == "array":
        return list[_checked(schema["items"], defs)]  # type: ignore[misc]
    if "properties" in schema and kind == "object":
        parts = {name: _checked(each, defs) for name, each in schema["properties"].items()}
        optional = parts.keys() - set(schema.get("required", ()))
        fields = [(name, each, None) if name in optional else (name, each) for name, each in parts.items()]
        return msgspec.defstruct("Part", fields, forbid_unknown_fields=True, kw_only=True)
    bounds = _BOUNDS.get("number" if kind == "integer" else kind, {})
    found = {name: schema[key] for key, name in bounds.items() if key in schema}
    if kind != "object":
        return Annotated[_PLAIN[kind], msgspec.Meta(**found)] if found else _PLAIN[kind]
    names = _checked({"type": "string", **schema["propertyNames"]}, defs)
    return Annotated[GenericAlias(dict, (names, _checked(schema["additionalProperties"], defs))), msgspec.Meta(**found)]


def _problems(document: Any, schema: Mapping[str, Any]) -> str:
    """The first problems, those of the whole before those of its parts, and how many more; empty without one."""
    from jsonschema import Draft202012Validator

    found = list(islice(Draft202012Validator(schema).iter_errors(document), _MOST_COUNTED))
    first = sorted(found, key=lambda problem: len(problem.absolute_path))[:_MOST_PROBLEMS]
    more = len(found) - len(first)
    counted = [f"and {'at least ' if len(found) == _MOST_COUNTED else ''}{more} more"] if more else []
    return "; ".join([*map(_sentence, first), *counted])


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


def read_given(path: Path) -> GivenReport:
    """The report in a folder, or of a file; raises ResultsError, also if a slug could leave its folder."""
    is_file = not path.is_dir() and (path.is_file() or path.suffix == ".json")
    file = path if is_file else path / FILE_NAME
    found = read_results(file)
    for outcome in found.outcomes:
        if len(outcome.slug) > MOST_SLUG or not SLUG.fullmatch(outcome.slug):
            shown = outcome.slug[:_SHOWN_PATH]
            raise ResultsError(f"{file}: '{shown}' is not a slug, expected lower-case letters, digits and hyphens")
    return found
