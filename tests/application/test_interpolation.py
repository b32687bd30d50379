"""Variables in compose files and ``.env`` files, read as compose reads them."""

import string
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.application import interpolation
from tests.application.composed import config

FILES: tuple[tuple[str, dict[str, str] | int], ...] = (
    ("# a comment\nPLAIN=word\nexport E=two words   # and a comment\nR=${PLAIN}-${ABSENT:-none}", {
        "PLAIN": "word", "E": "two words", "R": "word-none"}),
    ("A=   # note\nB=a\t# b\nC=a#b\nD=\nE=1 # c\nF=\"\" # c", {
        "A": "# note", "B": "a\t# b", "C": "a#b", "D": "", "E": "1", "F": ""}),
    ("A: yaml\nB = 3\n1C=4\nD-E.F[0]=5\n\u00c9=6\nG=a=b", {
        "A": "yaml", "B": "3", "1C": "4", "D-E.F[0]": "5", "\u00c9": "6", "G": "a=b"}),
    (r'''A="x\\y \"q\" l\nm $$A \$A \q\a\0123\0777\012"''', {"A": 'x\\y "q" l\nm $A $A \\q\aS\\777\\12'}),
    (r"A='a\nb $PLAIN it\'s ${'", {"A": "a\\nb $PLAIN it's ${"}),
    ('A="first\nsecond" B=2\r\nC="x\r\ny"z\nD=3\r\n', {"A": "first\nsecond", "B": "2", "C": "x\r\ny", "D": "3"}),
    ("OUTSIDE\nABSENT\nA=x\nA=$A:y\nA\nO=$OUTSIDE-$1 $ ${OUTSIDE:+z}\n", {
        "OUTSIDE": "out", "A": "x:y", "O": "out-$1 $ z"}),
    ("\ufeffA={\"a\": [1]}\nB=a\\nb\\\\\nC=`c` $(c)", {"A": '{"a": [1]}', "B": "a\\nb\\\\", "C": "`c` $(c)"}),
    ("A=1\nA B=1", 2), ("A;B=1", 1), ("A='it's'", 1), ('\nA="open\nB=1', 2), ("A='", 1),
    ("A=1\nB=${OPEN\nC=2", 2), ('A="${OPEN"', 1), ("A=${}", 1), ("A=${1}", 1), ("A=${B:=1}", 1), ('A="${B:-x\ny}"', 1),
)  # fmt: skip
"""Files of variables with their values, or the line at which compose stops."""


def read(path: Path, *, raw: bool = False) -> dict[str, str] | int:
    problem = interpolation.dotenv(path.read_bytes().decode(errors="replace"), raw=raw)[1]
    return problem.line if problem else interpolation.dotenv_file(path, {"OUTSIDE": "out"}, raw=raw)


@pytest.mark.parametrize(("text", "expected"), FILES)
def test_dotenv_files_are_read(tmp_path: Path, text: str, expected: dict[str, str] | int) -> None:
    (tmp_path / "a.env").write_bytes(text.encode())
    assert read(tmp_path / "a.env") == expected


@pytest.mark.slow
def test_dotenv_files_are_read_as_compose_reads_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OUTSIDE", "out")
    services: dict[str, Any] = {}
    for number, (text, expected) in enumerate(FILES):
        (tmp_path / f"{number}.env").write_bytes(text.encode())
        one = {f"s{number}": {"image": "x", "env_file": f"{number}.env"}}
        (tmp_path / "c.yml").write_text(yaml.safe_dump({"services": one}))
        if isinstance(expected, int):
            with pytest.raises(AssertionError):
                config(tmp_path, "-f", "c.yml")
        else:
            services |= one
    (tmp_path / "c.yml").write_text(yaml.safe_dump({"services": services}))
    shown = config(tmp_path, "-f", "c.yml")
    for name in services:
        values = {key: value.replace("$$", "$") for key, value in shown[name]["environment"].items()}
        assert values == FILES[int(name[1:])][1]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (b'A="x # y"\n B=$HOME \r\n# c\nOUTSIDE\nC=a # b\nABSENT', {
            "A": '"x # y"', "B": "$HOME ", "OUTSIDE": "out", "C": "a # b"}),
        (b"A=1\nB =2", 2),
        (b"=1", 1),
        (b"A=\xff", 1),
    ],
)  # fmt: skip
def test_raw_files_have_values_as_written(tmp_path: Path, text: bytes, expected: dict[str, str] | int) -> None:
    """As docker/cli reads ``--env-file``, by which Compose reads them from 2.30 on."""
    (tmp_path / "a.env").write_bytes(text)
    assert read(tmp_path / "a.env", raw=True) == expected


@given(st.dictionaries(st.text(string.ascii_letters, min_size=1), st.text(st.characters(exclude_characters="\0\r"))))
@pytest.mark.thorough
def test_dotenv_lines_are_read_back(values: dict[str, str]) -> None:
    doubled = {name: value.replace("$", "$$") for name, value in values.items()}
    lines = "\n".join(interpolation.dotenv_line(*pair) for pair in doubled.items())
    assert interpolation.dotenv(lines) == (list(doubled.items()), None)


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
