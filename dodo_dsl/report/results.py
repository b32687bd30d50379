"""``results.json``: the outcomes of a run, as ``schemas/results.schema.json`` describes them."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dodo_dsl.outcome import Outcome

FILE_NAME = "results.json"
VERSION = 1


class ResultsError(ValueError):
    """A file that holds no results of this version."""


def to_json(outcomes: Sequence[Outcome]) -> str:
    tests = [_rounded(dataclasses.asdict(outcome)) for outcome in outcomes]
    return json.dumps({"dodo": "results", "version": VERSION, "tests": tests}, indent=2, ensure_ascii=False) + "\n"


def _rounded(test: dict[str, Any]) -> dict[str, Any]:
    """Durations in milliseconds' precision: more would claim what nobody measured."""
    return {k: round(v, 3) if k.endswith("_s") and v is not None else v for k, v in test.items()}


def load(path: Path) -> list[Outcome]:
    """The outcomes of a ``results.json``; raises ResultsError."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["dodo"] != "results" or document["version"] != VERSION:
            raise ResultsError(f"{path}: not results of version {VERSION}")
        return [_outcome(t) for t in document["tests"]]
    except FileNotFoundError as error:
        raise ResultsError(f"there is no {path}") from error
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise ResultsError(f"{path}: no results of DoDo ({error})") from error


def _outcome(test: dict[str, Any]) -> Outcome:
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in test.items()}
    return Outcome(**values)
