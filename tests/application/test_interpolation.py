"""Variables in compose files and ``.env`` files, read as compose reads them."""

import string
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.application import interpolation
from tests.application.composed import config

DOTENV = r"""
# a comment
PLAIN=word
export EXPORTED=two words   # and a comment
HASH=a#b
DOUBLE="x\\y \"q\" l\nm $$A \$A"
SINGLE='a\nb $PLAIN it\'s'
REFERS=${PLAIN}-${ABSENT:-none}
MULTI="first
second" # after
EMPTY=
BACK=x\\y
YAML: value
SPACED = 3
"""
READ = {
    "PLAIN": "word",
    "EXPORTED": "two words",
    "HASH": "a#b",
    "DOUBLE": 'x\\y "q" l\nm $$A $$A',
    "SINGLE": "a\\nb $$PLAIN it's",
    "REFERS": "${PLAIN}-${ABSENT:-none}",
    "MULTI": "first\nsecond",
    "EMPTY": "",
    "BACK": "x\\\\y",
    "YAML": "value",
    "SPACED": "3",
}


def test_dotenv_files_are_read() -> None:
    assert interpolation.dotenv(DOTENV) == READ


@pytest.mark.slow
def test_dotenv_files_are_read_as_compose_reads_them(tmp_path: Path) -> None:
    service = {"image": "x", "environment": [f"{name}=${{{name}}}" for name in READ]}
    (tmp_path / "c.yml").write_text(yaml.safe_dump({"services": {"a": service}}))
    (tmp_path / ".env").write_text(DOTENV)
    expected = config(tmp_path, "-f", "c.yml")["a"]["environment"]
    read = interpolation.dotenv_file(tmp_path / ".env", {})
    assert read == {name: value.replace("$$", "$") for name, value in expected.items()}
    (tmp_path / ".env").write_text("".join(interpolation.dotenv_line(*pair) + "\n" for pair in READ.items()))
    assert config(tmp_path, "-f", "c.yml")["a"]["environment"] == expected


@given(st.dictionaries(st.text(string.ascii_letters, min_size=1), st.text(st.characters(exclude_characters="\0\r"))))
@pytest.mark.thorough
def test_dotenv_lines_are_read_back(values: dict[str, str]) -> None:
    doubled = {name: value.replace("$", "$$") for name, value in values.items()}
    assert interpolation.dotenv("\n".join(interpolation.dotenv_line(*pair) for pair in doubled.items())) == doubled


@pytest.mark.parametrize(
    ("text", "expected"),
    [("${A:-${B:-c}}", "c"), ("${A:-${S}}!", "set!"), ("${S:+${A:-x}y}", "xy"), ("$${S}$S}", "${S}set}"), ("${", "${")],
)
def test_variables_nest(text: str, expected: str) -> None:
    assert interpolation.interpolate(text, {"S": "set"}) == expected


def test_parts_outside_of_variables() -> None:
    assert interpolation.split_outside("${A:-b:c}:d", ":") == ["${A:-b:c}", "d"]
    assert interpolation.split_outside("$A:$$:c", ":") == ["$A", "$$", "c"]


@given(st.text(alphabet="a:${}-", max_size=20))
def test_parts_make_the_string_again(text: str) -> None:
    assert ":".join(interpolation.split_outside(text, ":")) == text


def test_names_of_variables() -> None:
    assert interpolation.names("$A ${B:-${C}} $$D ${} $1 $$$E") == {"A", "B", "C", "E"}
