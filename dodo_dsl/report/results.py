"""``results.json``: the outcomes of a run, as ``schemas/results.schema.json`` describes them."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dodo_dsl import package_data
from dodo_dsl.outcome import Outcome

FILE_NAME = "results.json"
VERSION = 1
_MOST_OF_A_FAULT = 200


class ResultsError(ValueError):
    """A file that holds no results of this version."""


def to_json(outcomes: Sequence[Outcome]) -> str:
    tests = [_rounded(dataclasses.asdict(outcome)) for outcome in outcomes]
    return json.dumps({"dodo": "results", "version": VERSION, "tests": tests}, indent=2, ensure_ascii=False) + "\n"


def writable(outcome: Outcome) -> Outcome:
    """The same with a question mark for what UTF-8 cannot write, as in the names of some files."""
    return dataclasses.replace(
        outcome,
        name=_written(outcome.name),
        spec=_written(outcome.spec),
        description=_written(outcome.description),
        reason=_written(outcome.reason),
        last_lines=tuple(map(_written, outcome.last_lines)),
        notes=tuple(map(_written, outcome.notes)),
    )


def _written(text: str) -> str:
    return text.encode(errors="replace").decode()


def _rounded(test: dict[str, Any]) -> dict[str, Any]:
    """Durations in milliseconds' precision: more would claim what nobody measured."""
    return {k: round(v, 3) if k.endswith("_s") and v is not None else v for k, v in test.items()}


def load(path: Path) -> list[Outcome]:
    """The outcomes of a ``results.json`` as its schema has them; raises ResultsError."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["dodo"] != "results" or document["version"] != VERSION:
            raise ResultsError(f"{path}: not results of version {VERSION}")
        _validate(document)
        return [_outcome(t) for t in document["tests"]]
    except FileNotFoundError as error:
        raise ResultsError(f"there is no {path}") from error
    except OSError as error:
        raise ResultsError(f"{path} cannot be read: {error.strerror}") from error
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise ResultsError(f"{path}: no results of DoDo ({error})") from error


def _validate(document: Any) -> None:
    """ValueError with the place and the fault that says most; texts have to be such as UTF-8 can write."""
    from jsonschema import Draft202012Validator
    from jsonschema.exceptions import best_match

    schema = json.loads((package_data.schemas() / "results.schema.json").read_text(encoding="utf-8"))
    fault = best_match(Draft202012Validator(schema).iter_errors(document))
    if fault is not None:
        raise ValueError(f"{fault.json_path}: {fault.message[:_MOST_OF_A_FAULT]}")
    json.dumps(document, ensure_ascii=False).encode()


def _outcome(test: dict[str, Any]) -> Outcome:
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in test.items()}
    return Outcome(**values)
