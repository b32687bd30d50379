"""What ``dodo compile --check`` finds in each row's files, in the folder ``rows``."""

import re
from pathlib import Path

import pytest

from dodo_dsl.check import catalogue
from tests.check import rows

FILES = sorted(rows.ROWS.glob("*.yml"))


@pytest.mark.parametrize("row", [row for file in FILES for row in rows.parameters(file)])
def test_found(row: rows.Row, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert rows.found(row, tmp_path, monkeypatch) == row.found


def test_each_rule_is_found() -> None:
    named = {
        line.removeprefix("warning ").split()[0] for file in FILES for row in rows.read(file) for line in row.found
    }
    for path in (Path(__file__).parent / "bad").glob("*.out"):
        named |= set(re.findall(r"(?:error|warning)\[([a-z-]+)\]: ", path.read_text()))
    assert named == set(catalogue.pages())
