"""The files of an application: each read once, within limits."""

from pathlib import Path

import pytest

from dodo_dsl.application.compose_files import MAX_FILES, MAX_TEXT, ComposeFiles, variables_of
from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Mapping, Scalar
from tests.source.nodes import mapping


def messages(files: ComposeFiles) -> list[str]:
    return [problem.message for problem in files.problems]


def word(text: str) -> Scalar:
    return Scalar(Span("x.yml"), text, text)


def test_a_file_is_read_once(tmp_path: Path) -> None:
    file = tmp_path / "a.yml"
    file.write_text("a: 1\n")
    files = ComposeFiles()
    first = files.document(file)
    file.write_text("a: 2\n")
    assert isinstance(first, Mapping)
    assert files.document(file) is first


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "the file is empty, expected a compose file"),
        ("- a", "the file is not a mapping, expected a compose file with services"),
        (f"a: {'x' * (MAX_TEXT + 1)}", f"a string of more than {MAX_TEXT} characters"),
    ],
)
def test_what_is_no_compose_file(content: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.yml").write_text(content)
    files = ComposeFiles()
    assert files.document(tmp_path / "a.yml") is None
    assert messages(files) == [message]


def test_too_many_values() -> None:
    files = ComposeFiles()
    node = mapping(f"a: [{'x,' * 15_000}]")
    assert [files.grow(node, node.span) for _ in range(4)] == [True, True, True, False]
    assert files.full
    assert messages(files) == ["more than 50000 values in all files"]


def test_files_of_the_repository(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "a.yml").write_text("a: 1\n")
    (tmp_path / "link.yml").symlink_to("a.yml")
    files = ComposeFiles(roots=(tmp_path,))
    assert files.other(word("../a.yml"), tmp_path / "sub") == tmp_path / "a.yml"
    assert files.problems == []
    for text in ("link.yml", "sub", "/a.yml", "~/a.yml", "${HOME}/a.yml", "https://example.org/a.yml", "git@x:a"):
        assert files.other(word(text), tmp_path) is None
    assert messages(files)[:2] == [
        "'link.yml' is a symbolic link, expected a regular file",
        "there is no file 'sub'",
    ]
    assert {message.partition("' ")[2] for message in messages(files)[2:]} == {
        "may differ between machines, expected a relative path"
    }


def test_too_many_files(tmp_path: Path) -> None:
    files = ComposeFiles()
    for number in range(MAX_FILES):
        (tmp_path / f"{number}.yml").write_text("a: 1\n")
        files.document(tmp_path / f"{number}.yml")
    assert files.other(word("0.yml"), tmp_path) is None
    assert messages(files) == [f"the application has more than {MAX_FILES} files"]


def test_variables_have_one_value(tmp_path: Path) -> None:
    (tmp_path / "a.env").write_text("A=1\nB=2\n")
    (tmp_path / "b.env").write_text("B=3\nC=4\n")
    files = ComposeFiles()
    for name in ("a.env", "b.env", "none.env"):
        files.gather(tmp_path / name, Span("x.yml"))
    assert files.variables == {"A": "1", "B": "2", "C": "4"}
    assert messages(files) == ["variable 'B' has another value in 'b.env' than in an earlier file"]


def test_symlinks_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "a.env").write_text("A=1\n")
    (tmp_path / "link.env").symlink_to("a.env")
    assert variables_of(tmp_path / "a.env") == {"A": "1"}
    assert variables_of(tmp_path / "link.env") == {}
