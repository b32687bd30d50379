"""The tables of compose's keys have every key of its schema and no other, and their page is up to date."""

from pathlib import Path

import pytest

from dodo_dsl.application.access import compose_keys
from dodo_dsl.application.access.model import Rows
from tests.application.access import keys_page
from tests.application.access.compose_forms import schema

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "compose-keys.md"


def keys(*names: str) -> set[str]:
    return {key for name in names for key in schema()["$defs"][name]["properties"]}


def below(definition: str, *steps: str) -> set[str]:
    """The keys of a mapping within a definition."""
    about = schema()["$defs"][definition]
    for step in steps:
        about = about["properties"][step]
    return set(about["properties"])


def of_object(definition: str, key: str, *steps: str) -> set[str]:
    """The keys of the long form of a value, or of a mapping in it."""
    about = schema()["$defs"][definition]["properties"][key]
    (form,) = (form for form in about.get("oneOf") or about["items"]["oneOf"] if "properties" in form)
    for step in steps:
        form = form["properties"][step]
    return set(form["properties"])


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (compose_keys.TOP, set(schema()["properties"])),
        (compose_keys.SERVICE, keys("service", "container_spec", "workload_spec")),
        (compose_keys.BUILD, of_object("workload_spec", "build")),
        (compose_keys.DEPLOY, keys("deployment")),
        (compose_keys.RESERVATIONS, below("deployment", "resources", "reservations")),
        (compose_keys.MOUNT, of_object("container_spec", "volumes")),
        (compose_keys.BIND, of_object("container_spec", "volumes", "bind")),
        (compose_keys.MOUNTED_VOLUME, of_object("container_spec", "volumes", "volume")),
        (compose_keys.VOLUME, keys("volume")),
        (compose_keys.NETWORK, keys("network")),
        (compose_keys.SECRET, keys("secret")),
        (compose_keys.CONFIG, keys("config")),
    ],
    ids=list(compose_keys.TABLES),
)
def test_each_key_has_a_row(rows: Rows, expected: set[str]) -> None:
    assert set(rows) == expected
    assert all(row.why for row in rows.values())


def test_the_page_is_up_to_date(update_goldens: bool) -> None:
    if update_goldens:
        PAGE.write_text(keys_page.text())
    assert PAGE.read_text() == keys_page.text(), "make goldens brings it up to date"
