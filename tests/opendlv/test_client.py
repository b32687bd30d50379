"""The client of applications in Python: what examples, starters and pages import is the part that stays."""

import re
from pathlib import Path

import pytest

from dodo_dsl import opendlv

ROOT = Path(__file__).parents[2]
FOLDERS = ("examples", "templates/new", "docs/how-to", "docs/reference", "docs/tutorial")
FILES = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".md")]
IMPORT = re.compile(r"(?:from|import) dodo_dsl\.opendlv(?:\.(?P<private>\w+)| import (?P<names>.+))")


def test_each_name_is_a_class() -> None:
    assert all(isinstance(getattr(opendlv, name), type) for name in opendlv.__all__)
    with pytest.raises(AttributeError, match="has no 'Sesion'"):
        opendlv.Sesion  # noqa: B018


def test_nothing_else_is_imported_where_people_learn() -> None:
    found = [match for path in FILES for match in IMPORT.finditer(path.read_text())]
    assert len(found) > 10
    assert not [match[0] for match in found if match["private"]]
    assert {name.strip() for match in found for name in match["names"].split(",")} <= {*opendlv.__all__}
