"""What the quick validator lets pass, against the one that says what is wrong."""

import copy
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.source import plain, read
from dodo_dsl.spec.schema_errors import is_valid
from dodo_dsl.spec.validation import _validator, validate

ROOT = Path(__file__).parents[3]
FILES = {
    "dodo": ROOT / "tests_registry" / "sil-closed-straight" / "sil-closed-straight.dodo.yml",
    "service": ROOT / "services" / "camera" / "service.yml",
    "deployment": ROOT / "dodo.yml",
    "application": ROOT / "examples" / "kiwi" / "docker-compose.yml",
}
VALUES = (
    None, True, 0, -1, 1.0, 0.5, 10**400, float("nan"), float("inf"), "", "x", "A b", "1 m", "1 M", "5 Hz", "10 %\n",
    "\ud83d", "٣ m", [], ["x", "x"], [1, True], {}, {"x": None}, {"uses": "x", "with": 1},
)  # fmt: skip
CHANGES = 120


def places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Each collection of a document with each key or index in it."""
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield value, key
            yield from places(value[key])


@pytest.mark.parametrize("schema", FILES)
def test_it_lets_pass_only_what_has_no_error(schema: str) -> None:
    document, chosen, refused = plain(read(FILES[schema])[0]), random.Random(1), 0  # type: ignore[arg-type]
    assert is_valid(document, schema)
    for _ in range(CHANGES):
        changed = copy.deepcopy(document)
        collection, key = chosen.choice(list(places(changed)))
        if chosen.random() < 0.2:
            del collection[key]
        elif isinstance(collection, dict) and chosen.random() < 0.2:
            collection["Unknown"] = chosen.choice(VALUES)
        else:
            collection[key] = chosen.choice(VALUES)
        error = next(_validator(schema).iter_errors(changed), None)
        if is_valid(changed, schema):
            assert error is None, (collection, key)
        else:
            refused += error is not None
    assert refused > CHANGES / 4


def test_what_is_valid_does_without_the_slow_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("dodo_dsl.spec.validation._validator")
    node, _ = read(FILES["dodo"])
    assert node
    assert validate(node, "dodo") == []
