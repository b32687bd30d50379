"""Whatever an editor shows of a key is there: each schema explains each of its keys."""

import functools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from dodo_dsl import package_data

FILES = sorted(package_data.schemas().glob("*.schema.json"))


def keys(schema: dict[str, Any], place: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every property that the schema names, with what it says of it; conditions name keys and explain nothing."""
    for word, below in schema.items():
        if word in ("properties", "$defs") and isinstance(below, dict):
            for name, about in below.items():
                if word == "properties":
                    yield f"{place}.{name}", about
                yield from keys(about, f"{place}.{name}")
        elif word in ("items", "additionalProperties") and isinstance(below, dict):
            yield from keys(below, f"{place}.{word}")


@pytest.mark.parametrize("file", FILES, ids=lambda p: p.name.partition(".")[0])
def test_each_key_is_described(file: Path) -> None:
    schema = json.loads(file.read_text())
    Draft202012Validator.check_schema(schema)
    assert schema["title"]
    assert schema["description"]
    own = [(place, about) for place, about in keys(schema) if not is_of_compose(file, place)]
    assert [place for place, about in own if not described(about, schema)] == []


def is_of_compose(file: Path, place: str) -> bool:
    """Whether a key is of the compose specification, whose own schema explains it."""
    return file.name == "application.schema.json" and "x-dodo" not in place and not place.startswith(".lines")


def described(about: dict[str, Any], schema: dict[str, Any]) -> bool:
    """Whether a key has a description, or what it refers to has one."""
    other, _, place = about.get("$ref", "").partition("#/")
    root = json.loads((package_data.schemas() / other).read_text()) if other else schema
    target = functools.reduce(lambda part, key: part[key], place.split("/"), root) if place else {}
    return bool(about.get("description") or target.get("description"))


@pytest.mark.parametrize("file", FILES, ids=lambda p: p.name.partition(".")[0])
def test_examples_and_defaults_are_allowed(file) -> None:
    schema = json.loads(file.read_text())
    for place, about in keys(schema):
        for value in (*about.get("examples", ()), *([about["default"]] if "default" in about else ())):
            errors = Draft202012Validator({**about, "$defs": schema.get("$defs", {})}).iter_errors(value)
            assert [e.message for e in errors] == [], (place, value)
