"""Services that extend others."""

import itertools
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.application.compose_files import ComposeFiles
from dodo_dsl.application.load import MAX_DEPTH, ExtendedService, extended, moved
from dodo_dsl.source import Mapping, plain
from tests.source.nodes import mapping

COMMON = "services: {base: {image: x, build: ., extends: {service: eyes}}, eyes: {environment: {A: 1}}}\n"


def resolved(folder: Path, text: str) -> tuple[Any, list[str]]:
    """The service ``a`` of a compose file, and the messages about it."""
    (folder / "sub").mkdir()
    (folder / "sub/common.yml").write_text(COMMON)
    (folder / "compose.yml").write_text(text)
    files = ComposeFiles()
    document = files.document(folder / "compose.yml")
    services = document.get("services") if document else None
    assert isinstance(services, Mapping)
    service = ExtendedService(folder / "compose.yml", folder, "a")
    node = extended(files, service, services.entries["a"].value)
    return plain(node), [problem.message for problem in files.problems]


def test_a_service_of_another_file(tmp_path: Path) -> None:
    text = "services: {a: {extends: {file: sub/common.yml, service: base}, environment: [B=2]}}\n"
    expected = {"environment": {"A": 1, "B": "2"}, "image": "x", "build": "./sub"}
    assert resolved(tmp_path, text) == (expected, [])


def test_a_service_of_the_same_file(tmp_path: Path) -> None:
    text = "services: {a: {extends: b, image: y}, b: {image: x, build: .}}\n"
    assert resolved(tmp_path, text) == ({"image": "y", "build": "."}, [])


@pytest.mark.parametrize(
    ("extends", "message"),
    [
        ("[b]", "'extends' does not name a service"),
        ("{file: sub/common.yml}", "'extends' does not name a service"),
        ("{file: [a], service: base}", "'extends' does not name a service"),
        ("{file: none.yml, service: base}", "there is no file 'none.yml'"),
        ("{file: sub/common.yml, service: bas}", "unknown service 'bas' to extend"),
        ("a", "a service extends itself: 'a' extends 'a'"),
    ],
)
def test_what_cannot_be_extended(extends: str, message: str, tmp_path: Path) -> None:
    own, messages = resolved(tmp_path, f"services: {{a: {{extends: {extends}, image: x}}}}\n")
    assert (own, messages) == ({"image": "x"}, [message])


def test_a_long_chain(tmp_path: Path) -> None:
    names = "abcdefghijklm"
    chain = ", ".join(f"{one}: {{extends: {other}}}" for one, other in itertools.pairwise(names))
    _, messages = resolved(tmp_path, f"services: {{{chain}, m: {{image: x}}}}\n")
    assert messages == [f"the chain of services that 'a' extends is longer than {MAX_DEPTH}"]


def test_paths_move_with_a_service() -> None:
    service = mapping("{build: ., env_file: [a]}")
    assert plain(moved(service, Path("/x/sub"), Path("/x"))) == {"build": "./sub", "env_file": ["./sub/a"]}
    assert moved(service, Path("/x"), Path("/x")) is service
