"""What no application sees, by the folders and files that DoDo knows."""

from pathlib import Path

import pytest

from dodo_dsl import compiler

SPEC = """\
dodo: 1
name: sil-a
matrix: {x: [a, b]}
environment:
  camera: {uses: virtual-camera, with: {map-path: ../maps/plain}}
evaluation:
  boxes: {uses: object-detection, with: {truth: "../truths/${matrix.x}.json"}}
"""


def compiled(root: Path, spec: str, application: str, deployment: str = "") -> compiler.Compilation:
    """A test in a repository; what it names lies beside its folder."""
    beside = Path(spec).parent.parent
    files = {
        spec: SPEC,
        application: "services: {a: {image: a, command: --cid=111}}",
        "tests/README.md": "",
        "own/README.md": "",
        ".git/config": "",
        "my.odvd": "",
    }
    files |= {str(beside / name): "{}" for name in ("maps/plain/map.json", "truths/a.json", "truths/b.json")}
    if deployment:
        files["dodo.yml"] = f"dodo: 1\n{deployment}\nmessages: [my.odvd]\napplication: {application}\n"
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return compiler.plan(compiler.load([root / spec], [root / application], start=root), root / "generated")


NAMED = ("maps/plain", "sil-a/sil-a.dodo.yml", "truths/a.json", "truths/b.json")


@pytest.mark.parametrize(
    ("deployment", "spec", "application", "expected"),
    [
        ("registry: [tests]", "tests/sil-a/sil-a.dodo.yml", "docker-compose.yml", ("tests",)),
        ("registry: [tests]\nservices: [own]", "tests/sil-a/sil-a.dodo.yml", "app/c.yml", ("../own", "../tests")),
        ("registry: [tests, .]", "sil-a/sil-a.dodo.yml", "docker-compose.yml", ("tests", *NAMED)),
        ("registry: [.]", "sil-a/sil-a.dodo.yml", "app/c.yml", tuple(f"../{name}" for name in NAMED)),
        ("registry: [tests]", "some/sil-a/sil-a.dodo.yml", "docker-compose.yml", ("some", "tests")),
        ("", "some/sil-a/sil-a.dodo.yml", "docker-compose.yml", ("some",)),
        ("", "sil-a/sil-a.dodo.yml", "docker-compose.yml", NAMED),
        ("", "app/tests/sil-a/sil-a.dodo.yml", "app/c.yml", ("tests",)),
    ],
)
def test_what_is_hidden(
    tmp_path: Path, deployment: str, spec: str, application: str, expected: tuple[str, ...]
) -> None:
    """From each test all specs and what any of them names, but no messages, which are the application's, too."""
    plans = compiled(tmp_path, spec, application, deployment).compiled.suite.plans
    assert [plan.application.hidden for plan in plans] == [expected, expected]
